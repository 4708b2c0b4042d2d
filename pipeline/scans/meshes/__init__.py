"""Faces of scanned and drawn meshes."""
