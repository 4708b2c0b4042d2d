"""Comparisons, each against its reference in the same run; their tables are written to `docs/`."""
