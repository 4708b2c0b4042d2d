"""Occupancy grids, Nav2 maps and octrees."""
