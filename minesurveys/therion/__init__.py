"""Therion centrelines, brought to Survex's form."""
