"""Solids of the legs of a survey, and of the stations where they meet."""
