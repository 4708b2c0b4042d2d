"""Read surveys of mines and caves: legs, outlines, meshes, points, grids and pictures, with their units and frames."""
