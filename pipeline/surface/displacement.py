"""How far the rock may stand out: displacements bounded smoothly by the room there is, with no clip anywhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.surface.lattice import Lattice
from pipeline.surface.walls import smoothstep


@dataclass(frozen=True)
class Bounds:
    """Displacement allowed, m.

    Where half the passage's width is at most `narrow_half_width_m`, each wall may take `narrow_share` of it, and all of
    it stands back by `narrow_recess_m`, which leaves its bumps room; from there to `wide_half_width_m` the bound rises
    smoothly to `wall_m` and the recess goes to nothing. No wall moves by more than `room_share` of the largest disc
    that touches it, in a bay of the workings as in a thin pillar. The roof moves by at most `roof_m`.
    """

    wall_m: float
    roof_m: float
    narrow_half_width_m: float
    wide_half_width_m: float
    narrow_share: float
    narrow_recess_m: float
    room_share: float


def bound_displacement(wanted_m: np.ndarray, lattice: Lattice, bounds: Bounds) -> np.ndarray:
    """Return displacements (n,) m, positive into the workings, as `bound * tanh(wanted / bound)`."""
    walls, column = lattice.walls, lattice.column
    half = walls.passage_m[column]
    wide = smoothstep((half - bounds.narrow_half_width_m) / (bounds.wide_half_width_m - bounds.narrow_half_width_m))
    narrow = bounds.narrow_share * np.minimum(half, bounds.narrow_half_width_m)
    inwards = np.minimum(narrow + (bounds.wall_m - narrow) * wide, bounds.room_share * walls.free_m[column])
    outwards = np.minimum(bounds.wall_m, bounds.room_share * walls.rock_m[column])
    wanted_m = wanted_m - bounds.narrow_recess_m * (1 - wide) * (1 - lattice.roof_share)
    wall = np.where(wanted_m > 0, inwards, outwards)
    bound = np.maximum(wall + (bounds.roof_m - wall) * lattice.roof_share, 1e-4)
    return bound * np.tanh(wanted_m / bound)


def displaced(lattice: Lattice, displacement_m: np.ndarray) -> np.ndarray:
    """Return the displaced vertices (n, 3), m, in whole tenths of a millimetre."""
    return np.round(lattice.vertices + displacement_m[:, None] * lattice.direction, 4)


def damp_near(
    places: np.ndarray, vertices: np.ndarray, displacement_m: np.ndarray, radius_m: float, factor: float
) -> np.ndarray:
    """Return displacements of vertices (n, 3), reduced to `factor` at places (k, 3) m and whole from a radius on."""
    near, _ = cKDTree(places).query(vertices, distance_upper_bound=radius_m)
    return displacement_m * (factor + (1 - factor) * smoothstep(np.minimum(near / radius_m, 1.0)))
