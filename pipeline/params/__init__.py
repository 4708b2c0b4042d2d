"""The stages' parameters: frozen schemas that reject what they do not know; units stand in the names."""
