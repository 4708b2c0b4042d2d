"""Floors: the heights of a plan with heights, their mesh, and outlines with fewer corners."""
