"""Which robots of a vector a reset is for, and infos of some robots as arrays over all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from minexplore.envs.call_checks import is_masked
from minexplore.tasks.exploration import StepOutcome


def mask_of(options: Mapping[str, Any] | None, count: int) -> np.ndarray:
    """Return which of `count` robots a reset is for, (count,) bool: all without `options["reset_mask"]`.

    Raises
    ------
    ValueError
        If the mask is not an array of truth values, one a robot, or names none.
    """
    mask = None if options is None else options.get("reset_mask")
    if mask is None:
        return np.ones(count, dtype=bool)
    if is_masked(mask):
        raise ValueError("reset_mask: want no masked values")
    found = np.asarray(mask)
    if found.dtype != bool or found.shape != (count,):
        raise ValueError(f"reset_mask of {found.dtype} with shape {found.shape}: want bool with shape ({count},)")
    if not found.any():
        raise ValueError("reset_mask: it names no robot")
    return found


def spread_info(outcome: StepOutcome, robots: np.ndarray, count: int) -> dict[str, Any]:
    """Return the info of some robots as arrays over all, with Gymnasium's masks `_key`."""
    mask = np.zeros(count, dtype=bool)
    mask[robots] = True
    info: dict[str, Any] = {}
    for key, value in outcome.info.items():
        every = np.zeros((count, *value.shape[1:]), dtype=value.dtype)
        every[robots] = value
        info[key], info[f"_{key}"] = every, mask.copy()
    return info


def merge_infos(info: dict[str, Any], other: dict[str, Any], robots: np.ndarray) -> dict[str, Any]:
    """Return infos over all robots with those of some, which began anew, in their place."""
    for key, value in other.items():
        if key in info:
            info[key][robots] = value[robots]
        else:
            info[key] = value
    return info
