"""Checks of results files, and driving them again."""
