"""The visible floor of a volume: muck over its floors, water, and shade in hollows."""
