"""LAS and LAZ files: their points, and the coordinate system that their records state."""
