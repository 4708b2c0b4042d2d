"""The mesh of the rock: walls, lattice, displacement, simplification and checks."""
