"""The world as MJCF: built, bundled, read back and rendered. A world is a place; it holds no robot."""
