"""Shafts that lean: where they bend, how long a stope is along its drift, and stopes of several steep legs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from typing import Protocol

import numpy as np

from minexplore.bundle import SLAB_M
from pipeline.geometry.floor.wall_foot import BAND_M
from pipeline.params.floor_rules import floor_rules
from pipeline.survey.passages.built_cells import Built, BuiltCells
from pipeline.types import Shaft

Bends = tuple[tuple[float, float, float], ...]

PLUMB_M = 0.5  # of a leaning shaft's ends, off the floor that it leaves and the roof that it meets
WIDEST_M, LONGEST_STOPE_M = 6.0, 30.0
_USUAL_SIDE_M = 1.5
_FROM_WORKINGS_M = 0.45  # of a leaning shaft's middle, over roofs and under floors
_DIGITS = 4
_BEND_M = 0.25  # a station so near to an end is no bend
_STEP_M = 0.5
_STOPE = 2.0  # times its usual width, a steep leg is a stope
_STRAIGHT = 0.94  # cosine of the angle between the drift at two stations of a stope, 20 deg
_OFF_LINE_M, _PILLAR_M = 1.0, 2 * SLAB_M + 0.5  # of stations beside the line of a stope; of rock between two shafts
_ALIKE = 0.36  # by which the lean of two shafts of a stope may differ, run over fall: 20 deg


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


def stope_length_m(along: np.ndarray, heading_rad: float, widths_m: Iterable[float]) -> float | None:
    """Return how long a leaning leg is along its drift, m, if it is a stope: it leads aside and is surveyed wide.

    Parameters
    ----------
    along : (2,) float64, m
        From the leg's first station to its second, in plan.
    heading_rad : float
        Of the drift.
    widths_m : iterable of float
        Across the leg, at its stations.
    """
    wide = min(widths_m)
    across = abs(along[1] * np.cos(heading_rad) - along[0] * np.sin(heading_rad)) > np.linalg.norm(along) / 2**0.5
    return min(wide, LONGEST_STOPE_M) if across and np.isfinite(wide) and wide > _STOPE * _USUAL_SIDE_M else None


def find_stopes(shafts: list[Shaft], built: Built, workings: BuiltCells) -> list[Shaft]:
    """Return the stopes: long shafts, and those that leave one drift side by side with less than 1 m of rock between.

    The latter are as long as their shafts with what is between, and lean as the deepest of them. There is none where
    it would meet workings.
    """
    found, left = [], list(shafts)
    while left:
        members = [left.pop(0)]
        while beside := next((s for s in left if any(_are_side_by_side(s, m) for m in members)), None):
            left.remove(beside)
            members.append(beside)
        stope = _join(members) if len(members) > 1 else members[0]
        if stope.long_m and _is_clear(stope, built, workings):
            found.append(stope)
    return found


def _is_clear(stope: Shaft, built: Built, workings: BuiltCells) -> bool:
    """Return whether a stope keeps off all workings between its ends."""
    reach_m, is_raise = reach_of(stope.side_m, stope.long_m), stope.sheet is None
    plan_sheet = stope.below if is_raise else stope.sheet
    assert plan_sheet is not None
    place = np.array([*(stope.place_m - built.offsets[plan_sheet]), built.datum_m])
    if stope.bends_m:
        return not _meets_workings(place + np.array(stope.bends_m), reach_m, workings)
    step = floor_rules().flat_step_m
    low = stope.bottom_m + (step if stope.below is not None else -reach_m)
    high = stope.top_m + (reach_m if is_raise else -step)
    return not workings.between(place[:2], low + built.datum_m, high + built.datum_m, reach_m)


def length_m(shaft: Shaft) -> float:
    """Return how long a shaft is along its drift, m."""
    return shaft.long_m or min(shaft.side_m or _USUAL_SIDE_M, WIDEST_M)


def _are_side_by_side(one: Shaft, two: Shaft) -> bool:
    same = (one.sheet, one.below) == (two.sheet, two.below) and np.abs(_lean(one) - _lean(two)).max() < _ALIKE
    if not same or abs(np.cos(one.heading_rad - two.heading_rad)) < _STRAIGHT:
        return False
    along, across = _beside(one, two)
    apart = abs(along) - (length_m(one) + length_m(two)) / 2
    return bool(abs(across) < _OFF_LINE_M and abs(along) > _BEND_M and apart < _PILLAR_M)


def _lean(shaft: Shaft) -> np.ndarray:
    """Return how far aside a shaft leads, east and north, over how deep it is."""
    if not shaft.bends_m:
        return np.zeros(2)
    first, last = np.array(shaft.bends_m)[[0, -1]]
    return np.asarray((last - first)[:2] / (first - last)[2])


def _beside(one: Shaft, two: Shaft) -> tuple[float, float]:
    """Return how far along and across its drift the one shaft's place is from the other's, m."""
    x, y = np.subtract(two.place_m, one.place_m)
    c, s = np.cos(one.heading_rad), np.sin(one.heading_rad)
    return float(x * c + y * s), float(y * c - x * s)


def _join(members: list[Shaft]) -> Shaft:
    """Return the stope of shafts that are side by side."""
    deepest = max(members, key=lambda shaft: shaft.top_m - shaft.bottom_m)
    ends = np.array([_beside(deepest, m)[0] + side * length_m(m) / 2 for m in members for side in (-1, 1)])
    middle = (ends.min() + ends.max()) / 2
    c, s = np.cos(deepest.heading_rad), np.sin(deepest.heading_rad)
    place = deepest.place_m[0] + float(middle * c), deepest.place_m[1] + float(middle * s)
    sides = [m.side_m for m in members if m.side_m and not m.long_m]
    return replace(deepest, place_m=place, long_m=float(np.ptp(ends)), side_m=min(sides, default=None))
