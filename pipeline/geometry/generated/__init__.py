"""Procedural mines, rough walls, and random variants of workings."""
