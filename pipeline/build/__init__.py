"""Build worlds other than the default one, each in its own folder, and families of worlds."""
