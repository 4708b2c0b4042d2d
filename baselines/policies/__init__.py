"""What a policy is, how one is found by name, and its files."""
