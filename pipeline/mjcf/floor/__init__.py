"""Visible floors: the grid over floors, muck on it, and a floor that collides as it looks."""
