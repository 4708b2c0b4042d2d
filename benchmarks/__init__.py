"""Measurements that take longer than a test. Each has its own make target."""

import pipeline  # noqa: F401  chooses the renderer; must come before the import of MuJoCo
