"""The environments: one robot, many, teams and families of mines."""
