"""Worlds beside the default one: all six stages in a folder of their own, and families of such worlds."""
