"""Clouds, sweeps and poses: reading, registration, and correction of a plan by sweeps."""
