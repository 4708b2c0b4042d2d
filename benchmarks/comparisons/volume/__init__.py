"""Mines as one closed volume: what docs/adr/0026-volume.md asks of them, measured."""
