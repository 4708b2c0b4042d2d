"""Sample a volume as a mobile scanner would: rays from a trajectory, noise, a hole, a person and a vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import manifold3d
import numpy as np

from pipeline.geometry.ray_scene import ray_scene
from pipeline.survey.clouds.voxels import cells_at, keys_of

_RANGE_M = 40.0
_ROWS, _COLUMNS = 32, 240
_NOISE_M = 0.02  # standard deviation of the ranges
_PERSON_M, _VEHICLE_M = (0.5, 0.35, 1.75), (4.2, 1.7, 1.7)
_UNDER_M = 0.35  # of the vehicle's body over the floor


@dataclass(frozen=True)
class Scan:
    """Points (n, 3) m, the trajectory (k, 3) m, and the middles (2, 3) m of the person and the vehicle.

    `time_s` (n,) is the row of the trajectory that a point was seen from: a row a second.
    """

    points_m: np.ndarray
    time_s: np.ndarray
    trajectory_m: np.ndarray
    things_m: np.ndarray


def _box(size: tuple[float, float, float], middle: np.ndarray, low: float) -> manifold3d.Manifold:
    return manifold3d.Manifold.cube(list(size), center=True).translate([*middle[:2], middle[2] + low + size[2] / 2])


def _things(person: np.ndarray, vehicle: np.ndarray, along_deg: float) -> manifold3d.Manifold:
    """Return a person and a vehicle on four wheels, standing at places on the floor."""
    body = _box(_VEHICLE_M, np.zeros(3), _UNDER_M)
    for x in (-1.4, 1.4):
        for y in (-0.7, 0.7):
            body += _box((0.7, 0.25, 0.7), np.array([x, y, 0]), 0.0)
    return _box(_PERSON_M, person, 0.0) + body.rotate([0, 0, along_deg]).translate(vehicle.tolist())


def _scene(*solids: manifold3d.Manifold) -> Any:
    meshes = [solid.to_mesh() for solid in solids]
    vertices = [np.array(mesh.vert_properties, np.float32)[:, :3] for mesh in meshes]
    first = np.cumsum([0, *map(len, vertices)])
    faces = [np.array(mesh.tri_verts) + start for mesh, start in zip(meshes, first, strict=False)]
    return ray_scene(np.concatenate(vertices), np.concatenate(faces))


def scan_of(
    truth: manifold3d.Manifold,
    way_m: np.ndarray,
    rng: np.random.Generator,
    per_m2: float,
    hole_m: float = 0.5,
    things: tuple[np.ndarray, np.ndarray, float] | None = None,
) -> Scan:
    """Return the scan of a volume along a way (k, 3) m of the scanner.

    Parameters
    ----------
    truth : manifold3d.Manifold
    way_m : (k, 3) float64, m
    rng : numpy.random.Generator
    per_m2 : float
        Points of a square metre, at most.
    hole_m : float
        Width of the hole that is cut into the scan.
    things : (person, vehicle, heading), optional
        Places on the floor, m, and degrees.
    """
    scene = _scene(truth) if things is None else _scene(truth, _things(*things))
    pitch = np.radians(np.linspace(-75, 75, _ROWS))
    turn = np.radians(np.arange(_COLUMNS) * 360 / _COLUMNS)
    found, times = [], []
    for row, place in enumerate(way_m):
        a, b = np.meshgrid(turn + rng.uniform(0, 0.1), pitch + rng.uniform(-0.02, 0.02))
        way = np.column_stack([(np.cos(b) * np.cos(a)).ravel(), (np.cos(b) * np.sin(a)).ravel(), np.sin(b).ravel()])
        rays = np.column_stack([np.broadcast_to(place, way.shape), way]).astype(np.float32)
        far = scene.cast_rays(rays)["t_hit"].numpy().astype(float)
        hit = far < _RANGE_M
        far = far[hit] + rng.normal(0, _NOISE_M, hit.sum())
        found.append(place + far[:, None] * way[hit])
        times.append(np.full(hit.sum(), float(row)))
    points, time_s = np.concatenate(found), np.concatenate(times)
    middle = points[rng.integers(len(points))]
    whole = np.linalg.norm(points - middle, axis=1) > hole_m / 2
    points, time_s = points[whole], time_s[whole]
    kept = _at_most(points, per_m2, rng)
    return Scan(points[kept], time_s[kept], way_m, np.zeros((0, 3)) if things is None else np.array(things[:2]))


def _at_most(points: np.ndarray, per_m2: float, rng: np.random.Generator, cell_m: float = 0.5) -> np.ndarray:
    """Return rows of points of which a cell's surface has no more than so many a square metre."""
    rows = rng.permutation(len(points))
    cell = keys_of(cells_at(points[rows], cell_m))
    order = np.argsort(cell, kind="stable")
    starts = np.flatnonzero(np.append(True, np.diff(cell[order]) != 0))
    rank = np.arange(len(points)) - np.repeat(starts, np.diff(np.append(starts, len(points))))
    return rows[order[rank < max(1, per_m2 * cell_m**2)]]
