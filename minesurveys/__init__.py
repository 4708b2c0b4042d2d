"""Read surveys of mines and caves: legs, outlines, meshes, points, grids and pictures, with their units and frames.

>>> import minesurveys
>>> survey = minesurveys.read("cave.svx")
>>> survey.positions_m, survey.legs, survey.crs
"""

from importlib import import_module
from typing import Any

__all__ = ["Content", "PlanPicture", "read"]


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(import_module("minesurveys.reading"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
