"""Sensors measured: their speed, real logs beside them, and what they look like."""
