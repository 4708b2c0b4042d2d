"""Measurements that take longer than a test. `python -m benchmarks` lists them."""

import os

CALLERS_ENVIRONMENT = dict(os.environ)  # before `pipeline` adds variables that other packages must not inherit

import pipeline  # noqa: E402, F401  chooses the renderer; must come before the import of MuJoCo
