"""Solids of workings, as planning and scanning programs write them: the triangles of their files."""
