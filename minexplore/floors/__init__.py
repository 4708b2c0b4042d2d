"""Floors: their zones, and the arrays of a world that is one volume."""
