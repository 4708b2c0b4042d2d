"""Shafts and raises in a folded floor."""
