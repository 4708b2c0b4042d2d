"""Surveys of stations in three dimensions: legs, grades and pieces."""
