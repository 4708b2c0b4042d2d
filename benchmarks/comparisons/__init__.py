"""Choices beside each other: rock, collision, texture, the paper."""
