"""How fast and how large: stages, environments, devices."""
