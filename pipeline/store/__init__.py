"""Artifacts on disk: codecs, hashes, manifests, and the registry of inputs."""
