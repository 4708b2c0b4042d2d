"""Shafts that lean: where they bend."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Protocol

import numpy as np

from minexplore.bundle import SLAB_M
from pipeline.geometry.floor.wall_foot import BAND_M
from pipeline.params.floor_rules import floor_rules
from pipeline.types import Shaft

Bends = tuple[tuple[float, float, float], ...]

PLUMB_M = 0.5  # of a leaning shaft's ends, off the floor that it leaves and the roof that it meets
WIDEST_M = 6.0
_USUAL_SIDE_M = 1.5
_FROM_WORKINGS_M = 0.45  # of a leaning shaft's middle, over roofs and under floors
_DIGITS = 4
_BEND_M = 0.25  # a station so near to an end is no bend
_STEP_M = 0.5


class FloorsAndRoofs(Protocol):
    """Floors and roofs by place."""

    def spans(self, place_m: np.ndarray, beside_m: float) -> np.ndarray:
        """Return the lowest floor and the highest roof (k, 2) m of each working so near to a place (2,) m."""


def follow(shaft: Shaft, places_m: np.ndarray, datum_m: float, workings: FloorsAndRoofs) -> tuple[Shaft, str]:
    """Return a shaft or raise with the bends of its way, and why it is not built, "" if it is.

    Parameters
    ----------
    shaft : Shaft
        With its width or its length along the drift.
    places_m : (k, 3) float64, m
        The way from the built station on, in the survey's coordinates.
    datum_m : float
    workings : FloorsAndRoofs
    """
    up = shaft.sheet is None
    opens_below = shaft.below is not None and not up
    bends, reason = bend(places_m, up, opens_below, reach_of(shaft.side_m, shaft.long_m), workings)
    heights = (bends - [0.0, 0.0, datum_m]).round(_DIGITS).tolist() if len(bends) else []
    return replace(shaft, bends_m=tuple((x, y, z) for x, y, z in heights)), reason


def bend(
    places_m: np.ndarray, up: bool, opens_below: bool, reach_m: float, workings: FloorsAndRoofs
) -> tuple[np.ndarray, str]:
    """Return the bends (k, 3) of a leaning shaft, from the highest down, and why it is not built, "" if it is.

    Its ends are plumb: at least half a metre below the floor that it leaves, or above the roof that it meets. Between
    them it follows its stations, and keeps off all workings.

    Parameters
    ----------
    places_m : (k, 3) float64, m
        The way from the built station on, in the survey's coordinates.
    up : bool
        Whether it is a raise.
    opens_below : bool
        Whether it meets the drift of its last station.
    reach_m : float
        From its middle, where workings are in its way.
    """
    start, end = places_m[0], places_m[-1]
    first = _end_m(start, workings, reach_m, roof=up)
    last = _end_m(end, workings, reach_m, roof=True) if opens_below else float(end[2])
    sign = 1.0 if up else -1.0
    if sign * (last - first) < PLUMB_M:
        return np.zeros((0, 3)), f"leaves {max(0.0, sign * (last - first)):.1f} m of rock between its ends"
    between = [p for p in places_m[1:-1] if sign * (p[2] - first) > _BEND_M and sign * (last - p[2]) > _BEND_M]
    bends = np.array([[*start[:2], first], *between, [*end[:2], last]])
    run, drop = np.linalg.norm(np.diff(bends[:, :2], axis=0), axis=1), np.abs(np.diff(bends[:, 2]))
    flattest = int((run / drop).argmax())
    if run[flattest] * floor_rules().steepest_grade > drop[flattest]:
        return np.zeros((0, 3)), (
            f"leans by {run[flattest]:.1f} m over {drop[flattest]:.1f} m of rock, at most "
            f"{1 / floor_rules().steepest_grade:.2f} of it"
        )
    if _meets_workings(bends, reach_m, workings):
        return np.zeros((0, 3)), "meets workings between its ends"
    bends[:, :2] -= start[:2]
    return bends[::-1] if up else bends, ""


def _end_m(place_m: np.ndarray, workings: FloorsAndRoofs, reach_m: float, roof: bool) -> float:
    """Return how high a leaning shaft is half a metre over the roofs about a place (3,) m, or under the floors."""
    spans = workings.spans(place_m[:2], reach_m)
    here = spans[(spans[:, 0] <= place_m[2] + _BEND_M) & (spans[:, 1] >= place_m[2])]
    if roof:
        return float(max(here[:, 1], default=place_m[2])) + PLUMB_M
    return float(min(here[:, 0], default=place_m[2])) - PLUMB_M


def _meets_workings(bends: np.ndarray, reach_m: float, workings: FloorsAndRoofs) -> bool:
    for a, b in pairwise(bends):
        for share in np.linspace(0, 1, max(2, int(np.ceil(np.linalg.norm(b - a) / _STEP_M)) + 1)).tolist():
            place = a + share * (b - a)
            floors, roofs = workings.spans(place[:2], reach_m).T
            if ((floors - _FROM_WORKINGS_M < place[2]) & (place[2] < roofs + _FROM_WORKINGS_M)).any():
                return True
    return False


def reach_of(side_m: float | None, long_m: float | None) -> float:
    """Return how far from its middle a leaning shaft and the rock round it reach, m."""
    wide = min(side_m or _USUAL_SIDE_M, WIDEST_M)
    return float(np.hypot(wide, long_m or wide)) / 2 + 3 * SLAB_M + BAND_M
