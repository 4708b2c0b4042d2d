"""Point clouds and scanned meshes, read in blocks."""
