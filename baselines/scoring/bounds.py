"""Bounds on coverage: the file that keeps them, and the bound of an environment at any time."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, TypeAdapter

import minexplore
from baselines.base.refusals import read_kept
from baselines.base.result_file import RESULTS, replace_text

BOUNDS = RESULTS / "bounds.json"


class Bound(BaseModel):
    """The most of `cells` that any robot can have seen by `time_s`; between two times the later one's value holds.

    `found` is what the best walk found sees by the same times, where it was kept: no bound can be lower than that.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    world_sha256: str
    inputs_sha256: str = ""  # of the world, the task, the robot's cells and the code; a bound of other inputs is stale
    cells: int
    time_s: list[float]
    most: list[int]
    found: list[int] = []

    def at(self, seconds: float) -> int:
        """Return the bound after so many seconds; after the last time it is the number of all cells."""
        later = int(np.searchsorted(self.time_s, seconds - 1e-9))
        return self.most[later] if later < len(self.most) else self.cells


_BOUNDS = TypeAdapter(dict[str, Bound])


def bounds_file(env_id: str) -> Path:
    """Return the file that keeps an environment's bound: mines of a split have one beside their results."""
    if env_id not in minexplore.FAMILY_MINES:
        return BOUNDS
    return BOUNDS.parent / env_id.removeprefix("MineXplore/").rpartition("-v")[0].rpartition("-")[0] / BOUNDS.name


def read_bounds(path: Path | None = None) -> dict[str, Bound]:
    """Return the bounds of a file by environment id; an environment without `python -m benchmarks oracle` has none.

    Raises
    ------
    BaselineError
        If the file cannot be read, or holds something else.
    """
    return read_kept(path or BOUNDS, _BOUNDS, {}, "bounds")


def write_bound(env_id: str, bound: Bound) -> None:
    """Write an environment's bound to the file of bounds."""
    path = bounds_file(env_id)
    kept = sorted((read_bounds(path) | {env_id: bound}).items())
    values = {env: bound.model_dump(exclude_defaults=True) for env, bound in kept}
    replace_text(path, json.dumps(values, indent=1) + "\n")


def bound_of(env_id: str, world_sha256: str) -> Callable[[float], int] | None:
    """Return the bound of an environment; None where it was never computed, or in another world."""
    bound = read_bounds(bounds_file(env_id)).get(env_id)
    return bound.at if bound is not None and bound.world_sha256 == world_sha256 else None
