"""Worlds that are one closed volume: floors under robots, their physics, and the cells that they reach."""
