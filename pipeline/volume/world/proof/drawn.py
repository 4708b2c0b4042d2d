"""How the floors of a volume follow the floors that were drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from pipeline.types import DrawnFloors, SurveyedLegs
from pipeline.volume.height_field.leg_lines import drop
from pipeline.volume.union import Volume

_ASIDE_M = 0.01  # of an edge: places so far to either side of it show a step; walls may be 4 mm nearer
_OVER_M = 0.3  # of a drawn floor, from which its height in the volume is looked for
_FAR_OFF_M, _MISSED_M = 0.005, 0.001
_IN_SHAFT_M = 1.5  # of the middle of a shaft, in half widths


@dataclass(frozen=True)
class DrawnError:
    """Largest and median distance between the floors and the drawn ones, and the largest step across edges, m."""

    error_m: float
    median_m: float
    step_m: float


def measure_drawn(volume: Volume, drawn: DrawnFloors, half_m: float) -> DrawnError:
    """Measure floors beside the edges and in the middles of all drawn triangles, but over shafts.

    A step is the difference of what two places on either side of an edge are off.
    """
    floors, shafts = drawn.mesh, drawn.shafts
    corners = floors.vertices[floors.faces]
    middle = corners.mean(axis=1)
    sides = (corners + np.roll(corners, -1, axis=1)) / 2
    inward = middle[:, None] - sides
    length = np.linalg.norm(inward[:, :, :2], axis=2, keepdims=True)
    beside = sides + inward * np.minimum(_ASIDE_M / np.maximum(length, 1e-9), 0.5)
    off = _off_m(volume, np.concatenate([middle, beside.reshape(-1, 3)]))
    if shafts is not None:
        off[_over_shafts(np.concatenate([middle, beside.reshape(-1, 3)]), shafts, half_m)] = 0.0
    start, end = floors.faces.ravel().astype(np.int64), np.roll(floors.faces, -1, axis=1).ravel().astype(np.int64)
    n = len(floors.vertices)
    order = np.argsort(start * n + end)
    at = np.minimum(np.searchsorted((start * n + end)[order], end * n + start), len(order) - 1)
    mate = order[at]
    shared = (start[mate] == end) & (end[mate] == start)
    edge = off[len(middle) :]
    steps = np.abs(edge[shared] - edge[mate[shared]])
    return DrawnError(float(np.abs(off).max()), float(np.median(np.abs(off))), float(steps.max(initial=0.0)))


def _off_m(volume: Volume, places: np.ndarray) -> np.ndarray:
    """Return by how much (n,) m the floor under each place is above it; where there is none, how far it was looked.

    A ray in 32 bits may pass between two facets: what is far off is looked up again a little aside.
    """
    found = np.full(len(places), np.inf)
    far = np.arange(len(places))
    for east, north in ((0.0, 0.0), (_MISSED_M, 0.0), (0.0, _MISSED_M), (-_MISSED_M, -_MISSED_M)):
        hit, height = drop(volume.vertices, volume.faces, places[far] + np.array([east, north, _OVER_M]))
        off = np.where(hit >= 0, height - places[far, 2], _OVER_M)
        found[far] = np.where(np.abs(off) < np.abs(found[far]), off, found[far])
        far = far[np.abs(found[far]) > _FAR_OFF_M]
    return found


def _over_shafts(places: np.ndarray, shafts: SurveyedLegs, half_m: float) -> np.ndarray:
    """Return which places (n, 3) are in or beside a shaft, seen from above."""
    ways = [shafts.positions_m[a:b, :2] for a, b in zip(shafts.first[:-1], shafts.first[1:], strict=True)]
    tree = shapely.STRtree([shapely.linestrings(way) for way in ways])
    found = np.zeros(len(places), bool)
    found[tree.query(shapely.points(places[:, :2]), predicate="dwithin", distance=_IN_SHAFT_M * half_m)[0]] = True
    return found
