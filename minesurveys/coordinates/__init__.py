"""Coordinate systems that files state: their axes and units, and plans in metres on the ground."""
