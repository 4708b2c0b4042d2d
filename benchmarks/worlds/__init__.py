"""Mines to build: random, rough, deep and small."""
