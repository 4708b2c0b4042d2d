"""Facets and convex bodies that reach into each other."""
