"""Surveys of stations in three dimensions: legs, pieces, shafts, and the sheets of their floor."""
