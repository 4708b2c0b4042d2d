"""Local models of a volume for the environment: the walls about a robot, and a plane under each of its feet."""
