"""Solids of workings, as planning and scanning programs write them: triangles read, closed, and joined to a volume."""
