"""What callers hand to an environment: actions, seeds, and the options of a reset."""

from __future__ import annotations

import numbers
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

POSES = ("true", "odometry")  # what infos hold as a robot's pose
MODES, _DEFAULT_CAMERA = ("rgb_array", "human"), "chase"
_DEEPEST = 4  # lists in lists; a list may hold itself

_PLAIN = (np.dtype(np.float32), np.dtype(np.float64))


def numbers_of(action: Any) -> np.ndarray:
    """Return an action, or the actions of many robots, as float64.

    Raises
    ------
    ValueError
        If it holds anything but numbers of 64 bits: texts, complex numbers, dates, or masked values.
    """
    if type(action) is np.ndarray and action.dtype in _PLAIN:  # as policies give them, at every step
        return action.astype(np.float64)
    try:
        if is_masked(action):
            raise TypeError("masked values")
        found = np.asarray(action)
        if found.dtype.kind == "O" and all(isinstance(value, numbers.Real) for value in found.ravel()):
            return found.astype(np.float64)
        if found.dtype.kind not in "biuf":
            raise TypeError(f"values of {found.dtype}")
        with np.errstate(over="raise"):
            return found.astype(np.float64)
    except (TypeError, ValueError, ArithmeticError) as error:
        raise ValueError(f"action = {_shown(action)}: want numbers ({error})") from error


def is_masked(value: Any, depth: int = _DEEPEST) -> bool:
    """Return whether a value, or one in its lists, has masked entries; deeper lists are no arrays and refused later."""
    if "numpy.ma" not in sys.modules:  # who has masked arrays has loaded it; it takes as long as 50 steps
        return False
    if isinstance(value, list | tuple):
        return depth > 0 and any(is_masked(inner, depth - 1) for inner in value)
    return isinstance(value, np.ma.MaskedArray) and bool(np.ma.getmaskarray(value).any())


def _shown(value: Any) -> str:
    return " ".join(repr(value).split())[:200]


def check_pose(pose: object) -> None:
    """Refuse a pose that is not one of `POSES`: `ValueError` names them."""
    if not isinstance(pose, str) or pose not in POSES:
        raise ValueError(f"pose = {pose!r}: valid choices are {', '.join(POSES)}")


def check_mode(mode: object) -> None:
    """Refuse a render mode of one robot that is none: `ValueError` names those that there are."""
    if mode is not None and (not isinstance(mode, str) or mode not in MODES):
        raise ValueError(f"render_mode = {mode!r}: valid choices are None, 'rgb_array', 'human'")


def check_camera(camera: object) -> None:
    """Refuse a camera that draws no pictures: `ValueError` names those that do."""
    if camera == _DEFAULT_CAMERA:  # what draws is loaded for others, or when it draws
        return
    from minexplore.pictures.render import CAMERAS

    if not isinstance(camera, str) or camera not in CAMERAS:
        raise ValueError(f"camera = {camera!r}: valid choices are {', '.join(CAMERAS)}")


def check_options(options: Any, known: Sequence[str]) -> None:
    """Refuse options of a reset that are no dict or have unknown keys: `ValueError` names those that there are."""
    if options is None:
        return
    if not isinstance(options, Mapping):
        raise ValueError(f"options = {options!r}: want a dict")
    unknown = [key for key in options if key not in known]
    if unknown:
        raise ValueError(f"options: unknown {unknown[0]!r}; there are: {', '.join(known) or 'none'}")


def spread_seeds(seed: Any, count: int) -> list[int | None]:
    """Return a seed for each of `count` robots: an int gives robot i the seed `seed + i`.

    Raises
    ------
    ValueError
        If they are not ints of 0 or more or None, or not as many as robots, or some are masked.
    """
    if is_masked(seed):
        raise ValueError(f"seed = {_shown(seed)}: want no masked values")
    if isinstance(seed, np.ndarray):
        seed = seed.tolist()
    if isinstance(seed, list | tuple):
        if len(seed) != count:
            raise ValueError(f"{len(seed)} seeds for {count} robots")
        seeds = list(seed)
    else:
        whole = isinstance(seed, int | np.integer) and not isinstance(seed, bool)
        seeds = [int(seed) + i for i in range(count)] if whole else [seed] * count
    for one in seeds:
        if one is not None and (not isinstance(one, int | np.integer) or isinstance(one, bool) or one < 0):
            raise ValueError(f"seed = {one!r}: want None or a whole number of 0 or more")
    return [None if one is None else int(one) for one in seeds]


def one_seed(seed: Any) -> int | None:
    """Return the seed of an environment of one robot.

    Raises
    ------
    ValueError
        If it is no int of 0 or more and not None; a list of one seed is none.
    """
    if isinstance(seed, list | tuple | np.ndarray):
        raise ValueError(f"seed = {_shown(seed)}: want None or a whole number of 0 or more")
    return spread_seeds(seed, 1)[0]
