"""Drawings with elevations: levels over each other, their ramps and shafts."""
