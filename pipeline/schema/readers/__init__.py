"""Bounded readers of a bundle's files."""
