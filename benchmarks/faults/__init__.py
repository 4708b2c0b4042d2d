"""Faults that the validator must find."""
