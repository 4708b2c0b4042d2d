"""Sweeps and poses of scanners: reading, registration, and correction of a plan by sweeps."""
