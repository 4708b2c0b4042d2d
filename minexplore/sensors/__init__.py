"""Sensors of an environment: what each one is, the table of them, and what reads them."""
