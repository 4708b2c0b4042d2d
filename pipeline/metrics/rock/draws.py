"""Means over draws of places, and how far the draws scatter."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from pipeline.metrics.rock.planefit import Residuals

T = TypeVar("T")


def mean_of(draws: Sequence[T]) -> T:
    """Return the mean of flat dataclasses, field by field; a figure that some draws lack is the mean of the others."""
    means: dict[str, Any] = {}
    for field in dataclasses.fields(draws[0]):  # type: ignore[arg-type]
        values = [value for draw in draws if (value := getattr(draw, field.name)) is not None]
        means[field.name] = float(np.mean(values)) if values else None
    return type(draws[0])(**means)


def mean_sweep(sweeps: Sequence[list[Residuals]]) -> list[Residuals]:
    """Return the mean residuals of draws by voxel size; voxels are counted together."""
    sizes = sorted({residuals.window_m for sweep in sweeps for residuals in sweep})
    at_size = ([r for sweep in sweeps for r in sweep if r.window_m == size] for size in sizes)
    return [dataclasses.replace(mean_of(found), voxels=sum(r.voxels for r in found)) for found in at_size]


def spread_of(values: Sequence[float | None]) -> float | None:
    """Return the standard deviation between draws, with one draw as the degree of freedom; None for one draw."""
    present = [value for value in values if value is not None]
    return float(np.std(present, ddof=1)) if len(present) > 1 else None
