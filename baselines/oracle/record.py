"""Bounds as they are kept, and the bound of an environment at any time."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict

BOUNDS = Path(__file__).parents[1] / "results" / "bounds.json"


class Bound(BaseModel):
    """The most of `cells` that any robot can have seen by `time_s`; between two times it is the later one's."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    world_sha256: str
    cells: int
    time_s: list[float]
    most: list[int]

    def at(self, seconds: float) -> int:
        """Return the bound after so many seconds; after the last time it is all cells."""
        later = int(np.searchsorted(self.time_s, seconds - 1e-9))
        return self.most[later] if later < len(self.most) else self.cells


def read_bounds(path: Path = BOUNDS) -> dict[str, Bound]:
    """Return the bounds by environment id; none where `make oracle` has not been run."""
    if not path.is_file():
        return {}
    return {env: Bound.model_validate(values) for env, values in json.loads(path.read_text()).items()}


def bound_of(env_id: str, world_sha256: str) -> Callable[[float], int] | None:
    """Return the bound of an environment in a world, if it is known for that very world."""
    bound = read_bounds().get(env_id)
    return bound.at if bound is not None and bound.world_sha256 == world_sha256 else None
