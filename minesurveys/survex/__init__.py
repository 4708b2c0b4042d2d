"""What Survex is given to solve beside a file's own lines, and what it says of its solution."""
