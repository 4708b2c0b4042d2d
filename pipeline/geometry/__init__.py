"""Plane and solid geometry. The functions take and return arrays and shapely geometries, and touch no files."""
