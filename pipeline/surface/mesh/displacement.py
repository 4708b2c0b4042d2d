"""Bound displacements smoothly, without clipping, by the space around the wall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.surface.mesh.lattice import Lattice
from pipeline.surface.mesh.walls import smoothstep

_AS_NARROW = 1.1  # of the narrowest half width: stations measure a width to a few per cent
_FOOT_M = 0.5  # blocks lean out of a wall's foot


@dataclass(frozen=True)
class Bounds:
    """Bounds on the displacement, m.

    In a passage with a half width up to `narrow_half_width_m`, a wall moves inwards by at most `narrow_share` of the
    half width, and is first moved back by `narrow_recess_m` to make space for its bumps. The relief is first multiplied
    by `narrow_gain`, because the bound flattens it. From there to `wide_half_width_m` the bound rises smoothly to
    `wall_m`, the recess falls to zero and the gain to one. Passages about as narrow as the narrowest of the mine keep
    `narrow_share` too, whatever their width: the narrowest passage decides which robots get through. No wall moves by
    more than `room_share` of the radius of the largest disc that touches it, in the workings or in the rock. The roof
    moves by at most `roof_m`.

    All displacements shrink by one factor if half of a wall's points at one height move by more than `median_m`. The
    relief of a mine of a few walls may be all to one side.
    """

    wall_m: float
    roof_m: float
    narrow_half_width_m: float
    wide_half_width_m: float
    narrow_share: float
    narrow_recess_m: float
    narrow_gain: float
    room_share: float
    median_m: float


@dataclass(frozen=True)
class Room:
    """Space about the points (n,) of a surface, m.

    `half_m` is half the width of the passage, `free_m` and `rock_m` are the radii of the largest discs that touch the
    surface in the workings and in the rock. `roof_share` is 1 on a roof that `Bounds.roof_m` bounds alone.
    """

    half_m: np.ndarray
    free_m: np.ndarray
    rock_m: np.ndarray
    roof_share: np.ndarray
    narrowest_m: float


def bound_displacement(wanted_m: np.ndarray, lattice: Lattice, bounds: Bounds) -> np.ndarray:
    """Return displacements (n,) m, positive into the workings: `bound * tanh(wanted / bound)` within `median_m`."""
    walls, column = lattice.walls, lattice.column
    half, free, rock = (about[column] for about in (walls.passage_m, walls.free_m, walls.rock_m))
    moved = bound_by_room(wanted_m, Room(half, free, rock, lattice.roof_share, walls.narrowest_m), bounds)
    median_m = _median_m(moved, lattice)
    return moved if median_m <= bounds.median_m else moved * (bounds.median_m / median_m)


def bound_by_room(wanted_m: np.ndarray, room: Room, bounds: Bounds) -> np.ndarray:
    """Return displacements (n,) m, positive into the workings: `bound * tanh(wanted / bound)`, of any median."""
    wide = _wide(room.half_m, room.narrowest_m, bounds)
    narrow = bounds.narrow_share * np.minimum(room.half_m, bounds.narrow_half_width_m)
    max_inwards = np.minimum(narrow + (bounds.wall_m - narrow) * wide, bounds.room_share * room.free_m)
    max_outwards = np.minimum(bounds.wall_m, bounds.room_share * room.rock_m)
    wanted_m = (1 + (bounds.narrow_gain - 1) * (1 - wide)) * wanted_m
    wanted_m = wanted_m - bounds.narrow_recess_m * (1 - wide) * (1 - room.roof_share)
    wall = np.where(wanted_m > 0, max_inwards, max_outwards)
    bound = np.maximum(wall + (bounds.roof_m - wall) * room.roof_share, 1e-4)
    moved: np.ndarray = bound * np.tanh(wanted_m / bound)
    return moved


def _median_m(moved_m: np.ndarray, lattice: Lattice) -> float:
    """Return the largest median of displacements over the wall's rows that lie above its foot, m."""
    upright = lattice.vertices[: lattice.wall_vertices : len(lattice.walls.xy), 2] >= _FOOT_M
    rows = np.abs(moved_m[: lattice.wall_vertices]).reshape(lattice.rows, -1)
    return float(np.median(rows[upright], axis=1).max(initial=0.0))


def _wide(half_m: np.ndarray, narrowest_m: float, bounds: Bounds) -> np.ndarray:
    """Return how far (n,), from 0 to 1, half widths (n,) m are on the way from the narrow bound to `wall_m`.

    The mine's narrowest passage, and those up to `_AS_NARROW` wider, stay where the bound is `narrow_share` of their
    half width; from there on it rises as elsewhere.
    """
    reach = bounds.wide_half_width_m - bounds.narrow_half_width_m
    wide = smoothstep((half_m - bounds.narrow_half_width_m) / reach)
    least = bounds.narrow_share * bounds.narrow_half_width_m
    kept = np.clip((bounds.narrow_share * half_m - least) / (bounds.wall_m - least), 0.0, 1.0)
    wider = smoothstep((half_m - _AS_NARROW * narrowest_m) / reach)
    return np.minimum(wide, kept + (1.0 - kept) * wider)


def displaced(lattice: Lattice, displacement_m: np.ndarray) -> np.ndarray:
    """Return the displaced vertices (n, 3) m, rounded to 0.1 mm."""
    vertices: np.ndarray = np.round(lattice.vertices + displacement_m[:, None] * lattice.direction, 4)
    return vertices


def damp(displacement_m: np.ndarray, distance_m: np.ndarray, radius_m: float, factor: float) -> np.ndarray:
    """Return displacements (n,) m, scaled by `factor` where a distance (n,) m is 0 and unchanged beyond a radius."""
    return displacement_m * (factor + (1 - factor) * smoothstep(np.minimum(distance_m / radius_m, 1.0)))
