"""The folded floor: its mesh, heights, sheets, seams and convex parts."""
