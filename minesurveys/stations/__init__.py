"""Station surveys: the project's table, Survex data and Compass plots."""
