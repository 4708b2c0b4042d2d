"""A mine with heights as one closed volume of free space: the union of its legs, its floors, and the rock behind it."""
