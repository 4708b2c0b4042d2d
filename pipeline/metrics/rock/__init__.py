"""Measures of rock: roughness, relief, profiles and the six texture axes."""
