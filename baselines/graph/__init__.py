"""A learned explorer: a network scores the clusters of the frontier of the robot's own map; a simulator trains it."""
