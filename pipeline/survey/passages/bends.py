"""The sectors on the outside of bends: between the sections of legs that meet at a station."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

_LEAST_RAD = 1e-6  # of a sector that is more than rounding


@dataclass(frozen=True)
class LegEnd:
    """A leg as seen from one of its stations: the way along it and the direction to its left wall, in plan, each (2,).

    `walls_m` are the distances to its left and right wall there.
    """

    ahead: np.ndarray
    to_left: np.ndarray
    walls_m: tuple[float, float]

    @property
    def direction_rad(self) -> float:
        """Return the direction of the way along it, from east to north."""
        return float(np.arctan2(self.ahead[1], self.ahead[0]))

    @property
    def turn_rad(self) -> float:
        """Return by how much its left wall is to the left of its way."""
        x, y = self.ahead
        return float(np.arctan2(x * self.to_left[1] - y * self.to_left[0], self.ahead @ self.to_left))


@dataclass(frozen=True)
class OuterSector:
    """The sector from the left wall of one leg to the right wall of the next to the left, by their numbers.

    `share` (k,) is how far from the first to the second its corners are, `directions` (k, 2) lead there.
    """

    one: int
    other: int
    share: np.ndarray
    directions: np.ndarray

    def radii_m(self, at_one: float, at_other: float) -> np.ndarray:
        """Return a radius (k,) m that grows evenly from one leg to the other."""
        found: np.ndarray = at_one + self.share * (at_other - at_one)
        return found


def outer_sectors(ends: list[LegEnd], step_rad: float, overlap_rad: float) -> list[OuterSector]:
    """Return the sectors about a station that no leg fills: on the outside of a bend, where sections open like a fan.

    Legs count in the order of their directions. One whose section is the next one's leaves nothing open.

    Parameters
    ----------
    ends : list of LegEnd
        Legs that have a length in plan.
    step_rad : float
        Between corners of an arc, at most.
    overlap_rad : float
        Of a sector with the legs beside it: shapes that only touch leave slits.
    """
    if len(ends) < 2:
        return []
    order = sorted(range(len(ends)), key=lambda k: ends[k].direction_rad)
    found = []
    for one, other in pairwise([*order, order[0]]):
        first, second = ends[one], ends[other]
        begin = first.direction_rad + first.turn_rad
        between = (second.direction_rad - first.direction_rad) % (2 * np.pi)
        turn = between + second.turn_rad - np.pi - first.turn_rad
        if turn > _LEAST_RAD and max(first.walls_m[0], second.walls_m[1]) > 0:
            share = np.linspace(0.0, 1.0, int(np.ceil(turn / step_rad)) + 1)
            angle = begin + share * turn + overlap_rad * np.linspace(-1.0, 1.0, len(share))
            found.append(OuterSector(one, other, share, np.column_stack([np.cos(angle), np.sin(angle)])))
    return found
