"""Surveys in three dimensions: the walls of their legs."""
