"""Textures and texture coordinates of rock."""
