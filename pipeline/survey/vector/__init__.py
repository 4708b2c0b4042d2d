"""Drawings: which of their shapes are walls or centrelines of workings."""
