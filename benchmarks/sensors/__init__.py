"""Sensors: their speed, a comparison with real logs, and pictures of what they see."""
