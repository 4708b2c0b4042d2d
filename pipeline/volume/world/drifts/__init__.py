"""The drifts of a volume, each through many legs, and the lights along them."""
