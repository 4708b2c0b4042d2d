"""A prototype of mines as one closed volume, measured beside the folded floors (docs/adr/0026-volume.md)."""
