"""A stranger's policy in a sandbox."""
