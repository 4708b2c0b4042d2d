"""The free space of a scan: voxels that a flood reaches between thickened walls, as far as walls lie about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.survey.clouds.facing import SIGHT_M, OrientedPoints
from pipeline.survey.clouds.voxels import (
    SIDES,
    STEPS,
    cells_of_keys,
    components_of,
    grown,
    is_in,
    keys_of,
    offsets_of,
    sorted_once,
)

_ENCLOSED = 14  # of 26 directions end at a wall: at the mouth of a drift 17 do, one step beyond it 9
_BACKS = 3  # of 26 directions, more than fronts: in the plane of a hole; in rock it is 6 and more
_WHOLLY = 24  # of 26 directions about a place to begin from
_SIDES = 5  # a wall that is turned away by less than a tenth shows neither side
_FILLS = 8  # rounds: in each, dents of a flood's ends get a voxel less deep
_CANDIDATES = 3000
_TRIES = 12
_BIAS = 1 << 20


@dataclass(frozen=True)
class Flood:
    """The voxels that a flood reached, and those beside them in which it ended without a wall."""

    free: np.ndarray
    ends: np.ndarray


class Walls:
    """Voxels with points, how far off they are in 26 directions, and which of their sides is free."""

    def __init__(self, occupied: np.ndarray, size_m: float, points: OrientedPoints | None = None) -> None:
        """Sort the thickened voxels (sorted numbers) along each direction; without points no side is known."""
        self.thick = grown(occupied)
        self.size_m = size_m
        cells = cells_of_keys(self.thick)
        normals = np.zeros((len(cells), 3)) if points is None else points.normals_at((cells + 0.5) * size_m)
        self._lines = []
        for step in STEPS[len(STEPS) // 2 :]:
            along = _along(cells, step)
            order = np.argsort(along)
            self._lines.append((step, along[order], np.sign(np.rint(_SIDES * normals[order] @ step)).astype(np.int8)))

    def hits(self, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return in how many of 26 directions a wall lies within sight of cells (n, 3) that are no walls.

        The second (n,) is in how many more of them it shows its front than its back.
        """
        count, fronts = np.zeros(len(cells), int), np.zeros(len(cells), int)
        for step, line, side in self._lines:
            here = _along(cells, step)
            most = int(SIGHT_M / (self.size_m * np.linalg.norm(step)))
            after = np.searchsorted(line, here)
            at = np.minimum(after, len(line) - 1)
            seen = (after < len(line)) & (line[at] - here <= most)
            count += seen
            fronts -= seen * side[at]
            at = np.maximum(after - 1, 0)
            seen = (after > 0) & (here - line[at] <= most)
            count += seen
            fronts += seen * side[at]
        return count, fronts

    def enclose(self, cells: np.ndarray, directions: int) -> np.ndarray:
        """Return about which cells (n, 3) walls lie in so many directions, and do not clearly show their backs.

        In the rock between the turns of a decline walls lie about a place as they do in a drift.
        """
        count, fronts = self.hits(cells)
        return np.asarray((count >= directions) & (fronts >= -_BACKS))

    def flood(self, seeds: np.ndarray, within: np.ndarray | None = None) -> Flood:
        """Return what is reached from voxels (sorted numbers) by steps across their sides, within a set if given."""
        offsets = offsets_of(SIDES)
        front = seeds[~is_in(seeds, self.thick)]
        last, reached, ends = np.zeros(0, np.int64), [front], []
        while len(front):
            near = sorted_once((front[:, None] + offsets).ravel())
            near = near[~is_in(near, last) & ~is_in(near, front) & ~is_in(near, self.thick)]
            enclosed = self.enclose(cells_of_keys(near), _ENCLOSED)
            if within is not None:
                enclosed &= is_in(near, within)
            ends.append(near[~enclosed])
            last, front = front, near[enclosed]
            reached.append(front)
        free = np.unique(np.concatenate(reached))
        return self._filled(Flood(free, np.unique(np.concatenate([*ends, np.zeros(0, np.int64)]))))

    def _filled(self, flood: Flood) -> Flood:
        """Return a flood with the voxels at its ends of whose neighbours, but for walls, most are free.

        Where nobody saw a wall, in how many directions one lies differs from voxel to voxel: a flood ends as a sponge.
        The plane of a hole is no such place: about a voxel behind it a third of them are free.
        """
        free, ends = flood.free, flood.ends
        tried, about = ends, offsets_of(STEPS)
        for _ in range(_FILLS):
            near = tried[:, None] + about
            more = tried[2 * is_in(near, free).sum(axis=1) > (~is_in(near, self.thick)).sum(axis=1)]
            if not len(more):
                break
            free = sorted_once(np.concatenate([free, more]))
            beside = sorted_once((more[:, None] + offsets_of(SIDES)).ravel())
            ends = sorted_once(np.concatenate([ends, beside[~is_in(beside, self.thick)]]))
            ends = ends[~is_in(ends, free)]
            tried = ends[is_in(ends, sorted_once((more[:, None] + about).ravel()))]
        return Flood(free, ends)

    def flood_again(self, before: np.ndarray) -> Flood:
        """Return the flood of voxels (sorted numbers) that an earlier one reached between more walls."""
        left = before[~is_in(before, self.thick)]
        left = left[self.enclose(cells_of_keys(left), _ENCLOSED)]
        return self.flood(_largest_piece(left))


def _largest_piece(keys: np.ndarray) -> np.ndarray:
    if not len(keys):
        return keys
    part = components_of(keys)
    return np.asarray(keys[part == np.bincount(part).argmax()])


def _along(cells: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return a number (n,) of the line of each cell in a direction, and its place along it, as one number."""
    axis = int(np.flatnonzero(step)[0])
    place = cells[:, axis] * step[axis]
    across = [cells[:, k] - place * step[k] for k in range(3) if k != axis]
    one, two = (value + _BIAS for value in across)
    return np.asarray((one << 42) | (two << 21) | (place + _BIAS))


def largest_flood(walls: Walls, occupied: np.ndarray, rng: np.random.Generator) -> tuple[Flood, list[Flood]]:
    """Return the largest flood from places about which nearly all directions end at walls, and the others.

    Places lie half-way between a wall and the next one over it.
    """
    floors = occupied[rng.permutation(len(occupied))[:_CANDIDATES]]
    cells = cells_of_keys(floors)
    lift = 2 + np.arange(1, int(8.0 / walls.size_m), 2)
    column = cells[:, None] + lift[:, None] * np.array([0, 0, 1])
    taken = is_in(keys_of(column.reshape(-1, 3)), walls.thick).reshape(column.shape[:2])
    high = np.where(taken.any(axis=1), taken.argmax(axis=1), 0)
    places = cells + np.column_stack([np.zeros((len(cells), 2), int), lift[high // 2]])
    places = places[(high > 0)]
    places = places[walls.enclose(places, _WHOLLY)]
    found: list[Flood] = []
    for _ in range(_TRIES):
        if not len(places):
            break
        found.append(walls.flood(keys_of(places[:1])))
        places = places[~is_in(keys_of(places), found[-1].free)][1 if not len(found[-1].free) else 0 :]
    found.sort(key=lambda flood: -len(flood.free))
    if not found or not len(found[0].free):
        return Flood(np.zeros(0, np.int64), np.zeros(0, np.int64)), []
    return found[0], [other for other in found[1:] if len(other.free)]
