"""Scans sampled from volumes whose truth is known, and how well the volume comes back."""
