"""What each format states about its coordinates, and what the reader does with it."""
