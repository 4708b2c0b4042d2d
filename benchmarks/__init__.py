"""Measurements that take longer than a test, each with its own make target."""

import pipeline  # noqa: F401  it chooses the renderer, before MuJoCo is imported
