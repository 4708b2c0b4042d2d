"""Surveys in three dimensions: solved by Survex, or read from its result."""
