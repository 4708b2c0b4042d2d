"""Where the surface of a scan was not seen: holes, which are filled smoothly, and ends of what was scanned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

_LEAST_M2 = 0.03
_RIM_M = 0.8  # from a gap to the points that its filling follows
_ALIKE = 0.7  # of a point's normal with the gap's: a floor's hole follows the floor, not the wall beside it
_MOST_RIM, _LEAST_RIM = 400, 20
_FOLDS = 20  # rounds in which corners go back
_SMOOTH = 0.1  # of the thin plate: the noise of single points is not followed


@dataclass(frozen=True)
class Gap:
    """A part of the surface with no points near: its middle, m, its area, m2, and its corners' rows.

    `normal` (3,) is the sum of its facets', m2.
    """

    middle_m: tuple[float, float, float]
    area_m2: float
    corners: np.ndarray
    normal: np.ndarray

    @property
    def width_m(self) -> float:
        """Return the width of a circle of the same area."""
        return float(2 * np.sqrt(self.area_m2 / np.pi))


def find_gaps(vertices: np.ndarray, faces: np.ndarray, points_m: np.ndarray, far_m: float) -> list[Gap]:
    """Return the parts of a surface that are farther than `far_m` from all points, the largest first."""
    far = cKDTree(points_m).query(vertices, distance_upper_bound=far_m)[0] > far_m
    bare = faces[far[faces].any(axis=1)]
    if not len(bare):
        return []
    a, b, c = np.moveaxis(vertices[bare], 1, 0)
    normal = np.cross(b - a, c - a) / 2
    area, middle = np.linalg.norm(normal, axis=1), (a + b + c) / 3
    pairs = np.concatenate([bare[:, :2], bare[:, 1:]])
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), (len(vertices),) * 2)
    part = connected_components(graph, directed=False)[1][bare[:, 0]]
    order = np.argsort(part, kind="stable")
    found = []
    for rows in np.split(order, np.flatnonzero(np.diff(part[order])) + 1):
        if area[rows].sum() >= _LEAST_M2:
            x, y, z = np.average(middle[rows], axis=0, weights=area[rows] + 1e-12).tolist()
            corners = np.unique(bare[rows])
            found.append(Gap((x, y, z), float(area[rows].sum()), corners[far[corners]], normal[rows].sum(axis=0)))
    return sorted(found, key=lambda gap: -gap.area_m2)


@dataclass(frozen=True)
class GapPlate:
    """A thin plate through the points about a gap: the surface that is likely there.

    `corners_m` (n, 3) are the gap's, m, `towards` (3,) shows into the free space.
    """

    corners_m: np.ndarray
    middle_m: np.ndarray
    towards: np.ndarray
    aside: np.ndarray
    plate: RBFInterpolator

    def height_m(self, places: np.ndarray) -> np.ndarray:
        """Return how far places (n, 3) m are on the free side of the plate, m."""
        own = places - self.middle_m
        return np.asarray(own @ self.towards - self.plate(own @ self.aside.T))


def plates_of(
    vertices: np.ndarray, gaps: list[Gap], points_m: np.ndarray, normals: np.ndarray, most_m: float
) -> list[tuple[Gap, GapPlate]]:
    """Return the gaps that a thin plate through the points about them can close.

    `normals` (n, 3) of the points show into the free space. A gap whose points about it face other ways than it does,
    as at the end of a drift, has none, nor has one that is more than `most_m` from its plate on average: that is no
    hole, but something that nobody saw from all sides.
    """
    tree, found = cKDTree(points_m), []
    for gap in gaps:
        towards = -gap.normal / max(float(np.linalg.norm(gap.normal)), 1e-12)
        near = np.unique(np.concatenate(tree.query_ball_point(vertices[gap.corners], _RIM_M)).astype(int))
        near = near[normals[near] @ towards > _ALIKE]
        if len(near) < _LEAST_RIM:
            continue
        rim = points_m[near[:: max(1, len(near) // _MOST_RIM)]]
        aside, middle = np.linalg.svd(towards[None])[2][1:], rim.mean(axis=0)
        fit = RBFInterpolator((rim - middle) @ aside.T, (rim - middle) @ towards, smoothing=_SMOOTH)
        plate = GapPlate(vertices[gap.corners], middle, towards, aside, fit)
        if np.abs(plate.height_m(plate.corners_m)).mean() <= most_m:
            found.append((gap, plate))
    return found


def fill_gaps(vertices: np.ndarray, faces: np.ndarray, plates: list[tuple[Gap, GapPlate]]) -> np.ndarray:
    """Return vertices of which those in gaps lie on their plates, but for those of facets that would turn over."""
    moved, out = vertices.copy(), np.zeros(vertices.shape)
    for gap, plate in plates:
        moved[gap.corners] -= np.outer(plate.height_m(plate.corners_m), plate.towards)
        out[gap.corners] = -plate.towards
    lies = np.asarray(out.any(axis=1))[faces]
    own, lies = faces[lies.any(axis=1)], lies[lies.any(axis=1)]
    way = np.where(lies.all(axis=1)[:, None], out[own[:, 0]], _normals(vertices, own))
    for _ in range(_FOLDS):
        folded = np.einsum("ij,ij->i", way, _normals(moved, own)) <= 0
        back = np.unique(own[folded])
        if not (moved[back] != vertices[back]).any():
            break
        moved[back] = vertices[back]
    return moved


def _normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return np.cross(b - a, c - a)
