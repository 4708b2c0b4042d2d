"""Workings on a drawing: filled, hatched or as lines, among all else that a drawing shows."""
