"""The rock of mines with heights: folded by the floor, joined where sheets meet."""
