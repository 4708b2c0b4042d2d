"""Distances along a polyline, and lines on the floors of drifts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

_TURNS_M = 1e-6  # between the middles of two steps: the second one goes back


def rings_of(polygons: BaseGeometry) -> list[shapely.LinearRing]:
    """Return the rings of a polygon, or of several: of each the exterior first, then its holes."""
    return [ring for part in shapely.get_parts(polygons) for ring in (part.exterior, *part.interiors)]


def arc_length(points: np.ndarray) -> np.ndarray:
    """Return the length along a polyline from its first point to each of its points.

    Parameters
    ----------
    points : (n, k) m
        At least one point; k is 2 or 3.

    Returns
    -------
    (n,) m
        From zero to the length of the polyline.
    """
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def resample(path: np.ndarray, spacing_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Place points at even distances along a polyline.

    Parameters
    ----------
    path : (k, d) m
        Of two or three dimensions.
    spacing_m : float
        The distance is the nearest to this that divides the length evenly.

    Returns
    -------
    chainage : (n,) m
    points : (n, d) m
        The ends of the polyline included.
    """
    along = arc_length(path)
    chainage = np.linspace(0.0, along[-1], max(2, round(along[-1] / spacing_m) + 1))
    return chainage, np.column_stack([np.interp(chainage, along, axis) for axis in path.T])


def line_moments(points: np.ndarray) -> np.ndarray:
    """Return the integrals over each segment of a polyline.

    Parameters
    ----------
    points : (n, 2) m

    Returns
    -------
    (n - 1, 6)
        Of 1, x, y, x x, x y and y y along the segment: its length, m, first moments, m2, and second moments, m3.
    """
    step, middle = np.diff(points, axis=0), (points[:-1] + points[1:]) / 2
    (dx, dy), (x, y) = step.T, middle.T
    parts = np.column_stack([np.ones(len(x)), x, y, x * x + dx * dx / 12, x * y + dx * dy / 12, y * y + dy * dy / 12])
    return np.linalg.norm(step, axis=1)[:, None] * parts


def points_along(ring: np.ndarray, spacing_m: float) -> np.ndarray:
    """Place points (n, 2) m on a closed ring at even distances of about `spacing_m`, at least four."""
    along = arc_length(ring)
    at = np.linspace(0.0, along[-1], max(4, round(along[-1] / spacing_m)), endpoint=False)
    return np.column_stack([np.interp(at, along, ring[:, k]) for k in (0, 1)])


@dataclass(frozen=True)
class FloorLine:
    """A line on the floor of a drift, m, mine frame.

    Attributes
    ----------
    floor_m : (n, 3) float64
    left_m, right_m : (n,) float64
        From there to the ribs.
    ends_at_junctions : (bool, bool)
        Whether it begins and ends at one.
    """

    floor_m: np.ndarray
    left_m: np.ndarray
    right_m: np.ndarray
    ends_at_junctions: tuple[bool, bool] = (False, False)

    @property
    def length_m(self) -> float:
        """Return its length, m."""
        return float(arc_length(self.floor_m)[-1])

    def places(self, spacing_m: float) -> FloorPlaces:
        """Return places at even distances along it."""
        chainage, at = resample(self.floor_m, spacing_m)
        ahead = np.gradient(at[:, :2], axis=0) if len(at) > 2 else np.diff(at[:, :2], axis=0).repeat(2, axis=0)
        turns = np.flatnonzero(np.linalg.norm(ahead, axis=1) < _TURNS_M)  # where the line doubles back
        ahead[turns] = at[turns, :2] - at[turns - 1, :2]
        ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
        along = arc_length(self.floor_m)
        ribs = [np.interp(chainage, along, side_m) for side_m in (self.left_m, self.right_m)]
        return FloorPlaces(at, np.column_stack([-ahead[:, 1], ahead[:, 0]]), ribs[0], ribs[1])


@dataclass(frozen=True)
class FloorPlaces:
    """Places (n, 3) m on a floor, unit vectors (n, 2) to their left, and distances (n,) m to the left and right rib."""

    floor_m: np.ndarray
    left: np.ndarray
    left_m: np.ndarray
    right_m: np.ndarray

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.floor_m)

    def over(self, height_m: float) -> np.ndarray:
        """Return the places (n, 3) m so high over the floor."""
        return self.floor_m + np.array([0.0, 0.0, height_m])
