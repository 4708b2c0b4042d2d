"""Pictures of robots in a mine, and OpenGL."""
