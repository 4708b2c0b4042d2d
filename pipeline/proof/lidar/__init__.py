"""Real sweeps and rays in a world: replay, hold-out and parity."""
