"""A robot's own map, and the map as a graph."""
