"""Hold the floor level in a hairpin, where the two arms are one open space and the survey knows the station only."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from pipeline.params.floor_rules import floor_rules

_ACUTE = 0.34  # cosine of the angle between two arms; less acute ones hardly overlap
_CLEAR_M = 1.0  # of rock between two arms, from which on each has a floor of its own
_ONE_FLOOR_M = 0.3  # arms whose floors differ by less where they part are left as they are

Points = list[tuple[str, np.ndarray, np.ndarray, np.ndarray]]  # of a leg: node or "", place (3,), left and right (2,) m


@dataclass
class _HeldShot:
    """The points of a leg from one station to the next, and up to where the floor is held level from either end, m."""

    points: Points
    level_m: list[float]

    def arm(self, end: int) -> Points:
        """Return the points as seen from the first station (0) or the last (1)."""
        return self.points[::-1] if end else self.points

    def along_m(self, end: int = 0) -> np.ndarray:
        """Return the distance in plan (n,) of each point of an arm from its station."""
        places = np.array([place[:2] for _, place, _, _ in self.arm(end)])
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])


def level_hairpins(ways: list[Points], stations: list[set[str]]) -> None:
    """Hold the floors of two arms level from their station to where they part; change the heights in place.

    Two arms that leave a station at less than 70 deg share their first metres. Linear floors would put one arm's floor
    above the other's there. Both stay at the station's height until there is rock between them, and are linear from
    there to their next stations, whose heights do not change. An arm that would become steeper than `steepest_grade`,
    or that does not part from the other before its next station, stays as it is.

    Parameters
    ----------
    ways : list of list of (str, (3,), (2,), (2,))
        Points of each leg: node or "", place, left and right wall, m.
    stations : list of set of str
        The nodes of each leg that are stations.
    """
    shots = [shot for way, names in zip(ways, stations, strict=True) for shot in _shots(way, names)]
    meeting: dict[str, list[tuple[_HeldShot, int]]] = {}
    for shot in shots:
        for end in (0, 1):
            meeting.setdefault(shot.arm(end)[0][0], []).append((shot, end))
    for arms in meeting.values():
        for pair in combinations(arms, 2):
            reach_m = _parted_at(*(shot.arm(end) for shot, end in pair))
            for shot, end in pair if reach_m else ():
                shot.level_m[end] = max(shot.level_m[end], _next(shot.along_m(end), reach_m))
    for shot in shots:
        _hold_level(shot)


def _shots(way: Points, names: set[str]) -> list[_HeldShot]:
    at = [i for i, (node, *_) in enumerate(way) if node in names]
    return [_HeldShot(way[i : j + 1], [0.0, 0.0]) for i, j in pairwise(at)]


def _parted_at(one: Points, two: Points) -> float:
    """Return how far from their station two arms part, m; 0 if they need no level floor or never part."""
    arms = [np.array([place for _, place, _, _ in arm]) for arm in (one, two)]
    steps = [arm[-1, :2] - arm[0, :2] for arm in arms]
    lengths = [float(np.linalg.norm(step)) for step in steps]
    if min(lengths) == 0 or steps[0] @ steps[1] < _ACUTE * lengths[0] * lengths[1]:
        return 0.0
    half_m = [
        max(float(np.linalg.norm(wall - place[:2])) for _, place, *walls in arm for wall in walls) for arm in (one, two)
    ]
    units = [step / length for step, length in zip(steps, lengths, strict=True)]
    apart = float(np.linalg.norm(units[0] - units[1]))  # of places one metre along either arm
    reach = (sum(half_m) + _CLEAR_M) / max(apart, 1e-9)
    rise = [reach * (arm[-1, 2] - arm[0, 2]) / length for arm, length in zip(arms, lengths, strict=True)]
    if reach >= min(lengths) or abs(rise[0] - rise[1]) < _ONE_FLOOR_M:
        return 0.0
    return reach


def _next(along_m: np.ndarray, reach_m: float) -> float:
    """Return the place of the first point at or beyond a distance."""
    return float(along_m[min(int(np.searchsorted(along_m, reach_m)), len(along_m) - 1)])


def _hold_level(shot: _HeldShot) -> None:
    along = shot.along_m()
    length, (start, end) = along[-1], shot.level_m
    if not start and not end:
        return
    first, last = shot.points[0][1][2], shot.points[-1][1][2]
    rest = length - start - end
    if rest <= 0 or abs(last - first) > floor_rules().steepest_grade * rest:
        return
    heights = np.interp(along, [0.0, start, length - end, length], [first, first, last, last])
    for (_, place, _, _), height in zip(shot.points, heights, strict=True):
        place[2] = height
