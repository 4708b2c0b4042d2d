"""How a volume follows the scan that it was made from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.volume.enclosure import Inside
from pipeline.volume.union import Volume

_SAMPLES = 200_000  # points of the scan, and places on the surface
_SEEN_M = 0.3  # from a place of the surface to the next point


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
    off = -Inside(volume).distance_m(chosen)
    a, b, c = np.moveaxis(volume.vertices[volume.faces], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    facet = rng.choice(len(area), _SAMPLES, p=area / area.sum())
    places = np.einsum("ki,kij->kj", rng.dirichlet(np.ones(3), _SAMPLES), volume.vertices[volume.faces[facet]])
    seen = cKDTree(points_m).query(places, distance_upper_bound=_SEEN_M)[0] <= _SEEN_M
    figures = {
        "points": float(len(points_m)),
        **{f"within_{cm}cm": round(float((np.abs(off) <= cm / 100).mean()), 6) for cm in (5, 10, 30)},
        "median_mm": round(1e3 * float(np.median(off)), 3),
        "mean_mm": round(1e3 * float(off.mean()), 3),
        "rms_mm": round(1e3 * float(np.sqrt((off**2).mean())), 3),
        "seen_share": round(float(seen.mean()), 6),
    }
    return ScanDeviation(chosen, off, places[~seen], figures)
