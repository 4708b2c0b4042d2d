"""Surveys in three dimensions, read from the result of the program that solved them."""
