"""Bounds on coverage: the file that keeps them, and the bound of an environment at any time."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
from pydantic import BaseModel, ConfigDict

from baselines.result_file import RESULTS

BOUNDS = RESULTS / "bounds.json"


class Bound(BaseModel):
    """The most of `cells` that any robot can have seen by `time_s`; between two times the later one's value holds."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    world_sha256: str
    inputs_sha256: str = ""  # of the world, the task, the robot's cells and the code; a bound of other inputs is stale
    cells: int
    time_s: list[float]
    most: list[int]

    def at(self, seconds: float) -> int:
        """Return the bound after so many seconds; after the last time it is the number of all cells."""
        later = int(np.searchsorted(self.time_s, seconds - 1e-9))
        return self.most[later] if later < len(self.most) else self.cells


def read_bounds() -> dict[str, Bound]:
    """Return the bounds by environment id; an environment without `make oracle` has none."""
    if not BOUNDS.is_file():
        return {}
    return {env: Bound.model_validate(values) for env, values in json.loads(BOUNDS.read_text()).items()}


def write_bound(env_id: str, bound: Bound) -> None:
    """Write an environment's bound to the file of bounds."""
    BOUNDS.parent.mkdir(parents=True, exist_ok=True)
    bounds = {env: values.model_dump() for env, values in sorted((read_bounds() | {env_id: bound}).items())}
    fresh = BOUNDS.with_suffix(".new")
    fresh.write_text(json.dumps(bounds, indent=1) + "\n")
    fresh.replace(BOUNDS)


def bound_of(env_id: str, world_sha256: str) -> Callable[[float], int] | None:
    """Return the bound of an environment; None where it was never computed, or in another world."""
    bound = read_bounds().get(env_id)
    return bound.at if bound is not None and bound.world_sha256 == world_sha256 else None
