"""How a volume follows the scan that it was made from: its points, and rays from where its scanner was."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.geometry.ray_scene import ray_scene
from pipeline.surface.mesh.mesh_checks import join_meshes
from pipeline.types import Mesh
from pipeline.volume.union import Volume

_SAMPLES = 200_000  # points of the scan, and places on the surface
_SEEN_M = 0.3  # from a place of the surface to the next point
_OFF_M = 0.3  # by which a ray is longer or shorter: it passes through a wall, or stops at one that was not there
_PLACE_M, _PLACE_RAYS = 10.0, 100  # side of the cubes of scanner places, and rays of one at least


@dataclass(frozen=True)
class ScanDeviation:
    """Points (n, 3) m of a scan, how far each is from the surface (n,) m, positive in the rock, and a summary.

    `unseen_m` (k, 3) are places on the surface without a point within 30 cm.
    """

    points_m: np.ndarray
    off_m: np.ndarray
    unseen_m: np.ndarray
    figures: dict[str, float]


def measure_scan(volume: Volume, points_m: np.ndarray, rng: np.random.Generator) -> ScanDeviation:
    """Return how far the points of a scan are from a volume's surface, and how much of the surface was seen."""
    chosen = points_m[rng.permutation(len(points_m))[:_SAMPLES]]
    off = -volume.inside.distance_m(chosen)
    a, b, c = np.moveaxis(volume.vertices[volume.faces], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    facet = rng.choice(len(area), _SAMPLES, p=area / area.sum())
    places = np.einsum("ki,kij->kj", rng.dirichlet(np.ones(3), _SAMPLES), volume.vertices[volume.faces[facet]])
    seen = cKDTree(points_m).query(places, distance_upper_bound=_SEEN_M)[0] <= _SEEN_M
    figures = {
        "points": float(len(points_m)),
        **_summary(off),
        "mean_mm": round(1e3 * float(off.mean()), 3),
        "seen_share": round(float(seen.mean()), 6),
    }
    return ScanDeviation(chosen, off, places[~seen], figures)


def _summary(off_m: np.ndarray) -> dict[str, float]:
    return {
        **{f"within_{cm}cm": round(float((np.abs(off_m) <= cm / 100).mean()), 6) for cm in (5, 10, 30)},
        "median_mm": round(1e3 * float(np.median(off_m)), 3),
        "rms_mm": round(1e3 * float(np.sqrt((off_m**2).mean())), 3),
    }


@dataclass(frozen=True)
class RayDeviation:
    """Where rays of a scan ended (n, 3) m, how much longer they are in the world (n,) m, and a summary."""

    ends_m: np.ndarray
    off_m: np.ndarray
    figures: dict[str, float]


def measure_rays(volume: Volume, rock: Mapping[str, Mesh], rays_m: np.ndarray) -> RayDeviation:
    """Scan a world from where the scanner of its scan was, along the scan's own rays, and compare the ranges.

    The world is its visible rock and floor, or without rock the facets of the volume.

    Parameters
    ----------
    volume : Volume
    rock : mapping of name to Mesh
        The visible rock; empty in a light world.
    rays_m : (n, 2, 3) float64, m, mine frame
        Places of the scanner, and the points that it saw from there.

    Returns
    -------
    RayDeviation
        Its figures are those of points, of the ranges' differences, positive where the world's is longer; `p95_mm` of
        their sizes; `through_share` of rays that are more than 30 cm longer, as a wall is missing, and `short_share` of
        those that are as much shorter, as something is there that was not. `worst_within_10cm` is the least share of
        the places, cubes of 10 m from which 100 rays start, and `worst_*_m` the middle of those starts.
    """
    middle = volume.vertices.mean(axis=0)
    if rock:
        vertices, faces = join_meshes(dict(rock))
        scene = ray_scene(vertices - middle, faces)
        floors = volume.faces[volume.label == FacetLabel.FLOOR]
        scene.add_triangles((volume.vertices - middle).astype(np.float32), floors.astype(np.uint32))
    else:
        scene = ray_scene(volume.vertices - middle, volume.faces)
    starts, ends = rays_m[:, 0], rays_m[:, 1]
    way, measured = ends - starts, np.linalg.norm(ends - starts, axis=1)
    rays = np.column_stack([starts - middle, way / np.maximum(measured, 1e-9)[:, None]]).astype(np.float32)
    found = scene.cast_rays(rays)["t_hit"].numpy().astype(float)
    longest = float(np.linalg.norm(np.ptp(volume.vertices, axis=0)))  # of a ray that leaves the world
    off = np.minimum(found, longest) - measured
    figures = {
        "rays": float(len(rays_m)),
        **_summary(off),
        "p95_mm": round(1e3 * float(np.quantile(np.abs(off), 0.95)), 3),
        "through_share": round(float((off > _OFF_M).mean()), 6),
        "short_share": round(float((off < -_OFF_M).mean()), 6),
        **_worst_place(starts, np.abs(off) <= 0.1),
    }
    return RayDeviation(ends, off, figures)


def _worst_place(starts: np.ndarray, near: np.ndarray) -> dict[str, float]:
    """Return the least share of rays that are near, of cubes that they start in, and the middle of its starts."""
    _, place, count = np.unique(np.floor(starts / _PLACE_M), axis=0, return_inverse=True, return_counts=True)
    share = np.bincount(place.reshape(-1), near) / count
    share[count < _PLACE_RAYS] = np.inf
    if not np.isfinite(share).any():
        return {}
    worst = int(share.argmin())
    middle = starts[place.reshape(-1) == worst].mean(axis=0).round(1).tolist()
    names = ("worst_x_m", "worst_y_m", "worst_z_m")
    return {"worst_within_10cm": round(float(share[worst]), 6), **dict(zip(names, middle, strict=True))}
