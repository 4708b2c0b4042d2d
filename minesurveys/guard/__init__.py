"""The process that reads a user's file, its limits, and plain reading of files and numbers."""
