"""From a mine survey to a validated MuJoCo world: the library behind the six stages."""

import os

__version__ = "0.1.0"

# MuJoCo chooses its OpenGL when it is first imported; the pipeline renders off screen, wherever it runs.
os.environ.setdefault("MUJOCO_GL", "osmesa")
