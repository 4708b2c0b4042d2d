"""Measures of a world: one measure per file. Each value has its unit in its name."""
