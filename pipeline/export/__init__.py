"""Worlds as USD, SDF, glTF and OBJ: each written from a bundle, read back by its own loader, and proved."""
