"""What is measured of a world: one measure a file, each value with its unit in its name."""
