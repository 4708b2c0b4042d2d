"""Floors: zones, heights, shafts, and the fold of surfaces."""
