"""Cut convex holes into a surface: what of its faces lies over a hole of the plan is taken away."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely import Polygon

from pipeline.geometry.rock.partition import triangulate

_AT_CORNER = 1e-9  # of barycentric weights
_SAME_SHARE = 1e-7  # of an edge, at which two faces cut it
_LEAST_M2 = 1e-12
_CLEAR_M = 1e-4  # nothing of a surface is so near to a hole's border, which gives way by steps
_STEP_M, _STEPS = 1e-3, 20


@dataclass(frozen=True)
class CutSurface:
    """A surface with holes: the old points and new ones (n, 3) m, faces (m, 3), and what both were made of.

    `of_face` (m,) is the number of the face that each is a part of, `near` (n,) the old point nearest to each point.
    """

    points: np.ndarray
    faces: np.ndarray
    of_face: np.ndarray
    near: np.ndarray


def faces_over(points: np.ndarray, faces: np.ndarray, hole_m: np.ndarray) -> np.ndarray:
    """Return the numbers of the faces (m, 3) over points (n, 3) m that lie over a convex hole (k, 2) m of the plan."""
    corners = points[faces][:, :, :2]
    inside = (corners.min(axis=1) <= hole_m.max(axis=0)) & (corners.max(axis=1) >= hole_m.min(axis=0))
    near = np.flatnonzero(inside.all(axis=1))
    shared = shapely.intersection(shapely.polygons(corners[near]), Polygon(hole_m))
    return np.asarray(near[shapely.area(shared) > _LEAST_M2])


def cut_hole(points: np.ndarray, faces: np.ndarray, hole_m: np.ndarray) -> CutSurface:
    """Cut a hole into a surface.

    Faces beside the hole are divided where its border crosses their edges, alike on both sides of an edge, so that the
    surface stays joined. All faces over the hole are cut, also those over each other. Where a corner of the surface is
    within a tenth of a millimetre of the hole's border, the hole is made smaller, by a millimetre or a few.

    Parameters
    ----------
    points : (n, 3) m
    faces : (m, 3) int
    hole_m : (k, 2) m
        Corners of a convex hole in plan, counter-clockwise.
    """
    over = faces_over(points, faces, hole_m)
    hole = _clear_of(points, faces[over], Polygon(hole_m))
    made = _Made(points)
    parts, of_part = [], []
    for face in over.tolist():
        corners = faces[face]
        triangle = Polygon(points[corners, :2])
        for piece in shapely.get_parts(shapely.difference(triangle, hole)):
            if piece.area < _LEAST_M2 or not isinstance(piece, Polygon):
                continue
            places, local = triangulate(piece)
            number = made.numbers(places, corners)
            cut = number[local if triangle.exterior.is_ccw else local[:, ::-1]]
            parts.append(cut)
            of_part.append(np.full(len(cut), face))
    kept = np.setdiff1d(np.arange(len(faces)), over)
    return CutSurface(
        np.concatenate([points, np.reshape(made.points, (-1, 3))]),
        np.concatenate([faces[kept], *parts]).astype(faces.dtype),
        np.concatenate([kept, *of_part]).astype(int),
        np.concatenate([np.arange(len(points)), np.array(made.near, int)]),
    )


def _clear_of(points: np.ndarray, faces: np.ndarray, hole: Polygon) -> Polygon:
    """Return a hole, or one a little smaller, whose border and corners are near to no corner or edge of the faces."""
    corners = shapely.points(points[np.unique(faces), :2])
    edges = shapely.linestrings(points[faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), :2])
    for step in range(_STEPS):
        smaller = hole.buffer(-step * _STEP_M, join_style="mitre")
        away = shapely.distance(smaller.exterior, corners).min(initial=np.inf)
        for corner in shapely.points(smaller.exterior.coords[:-1]):
            away = min(away, shapely.distance(corner, edges).min(initial=np.inf))
        if away > _CLEAR_M:
            break
    return smaller


@dataclass
class _Made:
    """The points that a hole adds to a surface; those on an edge belong to both its faces."""

    old: np.ndarray
    points: list[np.ndarray] = field(default_factory=list)
    near: list[int] = field(default_factory=list)
    on_edge: dict[tuple[int, int], list[tuple[float, int]]] = field(default_factory=dict)

    def numbers(self, places: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """Return the numbers (k,) of the points at places (k, 2) m of the plan on a face of the old points."""
        system = np.vstack([self.old[corners, :2].T, np.ones(3)])
        weights = np.linalg.solve(system, np.vstack([places.T, np.ones(len(places))])).T
        return np.array([self._number(weight, corners) for weight in weights])

    def _number(self, weight: np.ndarray, corners: np.ndarray) -> int:
        share = weight > _AT_CORNER
        if share.sum() == 1:
            return int(corners[weight.argmax()])
        if share.sum() == 3:
            return self._add(weight @ self.old[corners], int(corners[weight.argmax()]))
        a, b = sorted(corners[share].tolist())
        along = float(weight[corners == b][0] / weight[share].sum())
        cuts = self.on_edge.setdefault((a, b), [])
        for other, number in cuts:
            if abs(other - along) < _SAME_SHARE:
                return number
        number = self._add(self.old[a] + along * (self.old[b] - self.old[a]), b if along > 0.5 else a)
        cuts.append((along, number))
        return number

    def _add(self, point: np.ndarray, near: int) -> int:
        self.points.append(point)
        self.near.append(near)
        return len(self.old) + len(self.points) - 1
