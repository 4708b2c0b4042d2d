"""Solids of workings: triangles closed, simplified, and joined to a volume."""
