"""Pictures and tables: the only package that uses matplotlib."""
