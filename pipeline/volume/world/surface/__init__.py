"""The visible rock of a volume: its walls and roofs refined, displaced by the relief of level mines, cut and shown."""
