"""The formats of an export: a writer and a reader each."""
