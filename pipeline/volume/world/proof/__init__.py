"""The certificate of a volume world: its measures by exact booleans, and bodies that are thrown and rest."""
