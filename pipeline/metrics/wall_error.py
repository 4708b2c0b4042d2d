"""How far the built walls stand from the traced ones, m."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import shapely
from shapely import Polygon

from pipeline.geometry.rasterize import fill_polygon
from pipeline.geometry.wall_distance import distances_to_walls, largest_error_m, points_on_walls
from pipeline.types import Frame, Mask


@dataclass(frozen=True)
class WallError:
    """Distances along the traced wall, and the mean distance of the traced wall from the drawn one.

    `mean_m` and `p99_m` are of |signed distance| at points every 5 cm of the traced wall; `max_m` is the largest
    distance of either wall from the other. `lost_m` and `gained_m` are the mean distances by which the built wall
    stands inside and outside the traced workings; they add up to the mean. `drawn_mean_m` is the area that tracing and
    cleaning added to or took from the drawn workings, per metre of wall.
    """

    mean_m: float
    p99_m: float
    max_m: float
    lost_m: float
    gained_m: float
    drawn_mean_m: float
    wall_m: float


def signed_distances(traced: Polygon, built: Polygon) -> np.ndarray:
    """Return the distances (n,) m of points on the traced wall from the built one; positive where it lost workings."""
    points = points_on_walls(traced)
    distance = distances_to_walls(built, points)
    shapely.prepare(built)
    return np.where(shapely.intersects_xy(built, points[:, 0], points[:, 1]), -distance, distance)


def measure_wall_error(traced: Polygon, built: Polygon, raw: Mask, frame: Frame) -> WallError:
    """Compare the built walls with the traced ones, and those with the drawing.

    Parameters
    ----------
    traced, built : shapely.Polygon, m, mine frame
        The workings as traced, and as the world holds them.
    raw : (rows, cols) bool
        The drawn workings, not cleaned.
    frame : Frame
        The pixel grid of `raw`.
    """
    signed = signed_distances(traced, built)
    distance = np.abs(signed)
    filled = fill_polygon(traced, frame)
    changed = float(np.count_nonzero(filled ^ _connected(raw, filled))) / frame.px_per_m**2
    figures = (
        distance.mean(),
        np.percentile(distance, 99),
        largest_error_m(traced, built),
        np.maximum(signed, 0).mean(),
        np.maximum(-signed, 0).mean(),
        changed / traced.length,
        built.length,
    )
    return WallError(*(round(float(value), 5) for value in figures))


def _connected(raw: Mask, filled: Mask) -> Mask:
    """Return the drawn pieces that touch the traced workings."""
    count, labels = cv2.connectedComponents(raw.astype(np.uint8), connectivity=8)
    touching = np.zeros(count, dtype=bool)
    touching[np.unique(labels[filled & raw])] = True
    touching[0] = False
    return touching[labels]
