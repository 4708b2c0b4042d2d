"""Training of the learned explorer in a simulator."""
