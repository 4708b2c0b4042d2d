"""Collision parts of the rock."""
