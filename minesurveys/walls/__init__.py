"""Walls projects (.wpj) and survey data (.srv), which newer versions of Survex solve."""
