"""Shafts without a fence: where a robot that falls is in the plan, and what it can touch on its way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from minexplore.bundle import COLLAR_CORNERS
from minexplore.floors.floor import Floor
from minexplore.floors.shaft_axis import has_fence

_LANDED_M = 1.0  # over the floor below: there the floor itself gives the sheet of a place
_SUNK_M = 0.1  # into a blind end, at most, when a robot lands
_OVER_M = 1.0  # over a collar, a robot at its edge is still about it
_ASIDE_M = 2.0  # of a shaft's foot that a falling robot may be, below the roof
_FALLEN_M = 0.5  # below its collar a robot has fallen


class OpenShafts:
    """The shafts of a world that robots can fall into; none where they are fenced. Those that lean always are."""

    def __init__(self, record: Mapping[str, Any], floor: Floor) -> None:
        """Take the openings of a world's record."""
        open_floors = [] if record.get("fenced", True) else [o for o in record["openings"] if o["sheet"] is not None]
        openings = [opening for opening in open_floors if not has_fence(opening, False)]
        sheet = np.array([opening["sheet"] for opening in openings], dtype=int)
        self.outlines_m = np.array([opening["outline_m"] for opening in openings]).reshape(
            len(openings), COLLAR_CORNERS, 2
        )
        self._aside = floor.offset_m[sheet]
        self._below = [opening["below"] for opening in openings]
        self._floor = floor
        self._roof_m = float(max(record.get("height_m", 0.0), *record.get("heights", {}).get("roof_m", (0.0,))))
        self.top_m, self.bottom_m = (np.array([o[name] for o in openings]) for name in ("top_m", "bottom_m"))

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.outlines_m)

    def inside(self, points_m: np.ndarray) -> np.ndarray:
        """Return the number of the shaft (k,) that each point (k, 3) m of the mine frame is in, or -1."""
        found = np.full(len(points_m), -1)
        for number in range(len(self)):
            low = self.bottom_m[number] + (-_SUNK_M if self._below[number] is None else _LANDED_M)
            within = (points_m[:, 2] > low) & (points_m[:, 2] < self.top_m[number] + _OVER_M)
            found[within & (self._beyond(number, points_m[:, :2]) <= 0)] = number
        return found

    def _beyond(self, number: int, places_m: np.ndarray) -> np.ndarray:
        """Return how far (k,) m places (k, 2) m of the mine frame are beyond a shaft's walls; negative within."""
        corners = self.outlines_m[number] - self._aside[number]
        along = np.roll(corners, -1, axis=0) - corners
        out = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
        return np.asarray(((places_m[:, None] - corners) * out).sum(axis=2).max(axis=1))

    def fallen(self, points_m: np.ndarray) -> np.ndarray:
        """Return whether points (k, 3) m of the mine frame are below the collar of the shaft that they are in."""
        number = self.inside(points_m)
        return (number >= 0) & (points_m[:, 2] < self.top_m[number] - _FALLEN_M)

    def move(self, places_m: np.ndarray, points_m: np.ndarray) -> None:
        """Put places (k, 2) m of the plan where falling points (k, 3) m of the mine frame are.

        In a shaft they are over its collar, and between the roof below and the floor in the plan of the sheet below.
        """
        number = self.inside(points_m)
        within = number >= 0
        places_m[within] = points_m[within, :2] + self._aside[number[within]]
        for k, below in enumerate(self._below):
            if below is None:
                continue
            above = points_m[:, 2] - self.bottom_m[k]
            beside = ~within & (above > _LANDED_M) & (above < self._roof_m)
            beside &= self._beyond(k, points_m[:, :2]) < _ASIDE_M
            places_m[beside] = points_m[beside, :2] + self._floor.offset_m[below]

    def lowest_within(self, low_m: np.ndarray, high_m: np.ndarray) -> float:
        """Return how deep the shafts go whose collars meet a box (2,) to (2,) m of the plan; infinity if none does."""
        least, most = self.outlines_m.min(axis=1), self.outlines_m.max(axis=1)
        near = ((least <= high_m) & (most >= low_m)).all(axis=1)
        return float(self.bottom_m[near].min(initial=np.inf))
