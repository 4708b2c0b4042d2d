"""Gymnasium environments in worlds compiled from real mine surveys; reads a world bundle and nothing else."""

from gymnasium.envs.registration import register

__version__ = "0.1.0"

_ENV = "minexplore.env:MineEnv"

register("MineXplore/World-v0", _ENV, order_enforce=True)
