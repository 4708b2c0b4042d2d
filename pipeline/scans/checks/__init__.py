"""Which points of a file can be read: those that were measured, are fine enough, and lie together."""
