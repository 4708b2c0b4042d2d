"""Pytest reads this first: the fixtures of `tests/`, for the tests of `baselines/` and `benchmarks/` too."""

pytest_plugins = ["tests.fixtures"]
