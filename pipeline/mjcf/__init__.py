"""The world as MJCF: it is built, bundled, read back and rendered here. A world contains no robot."""
