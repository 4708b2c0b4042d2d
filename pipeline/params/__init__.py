"""The parameters of the stages: frozen schemas that reject unknown keys; names end in their units."""
