"""The checks of an export: rays, pieces with their areas, and the clauses of the certificate."""
