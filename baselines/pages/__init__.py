"""Tables and profiles of results."""
