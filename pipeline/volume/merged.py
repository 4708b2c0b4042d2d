"""Fewer parts of the rock: parts whose common hull is in the rock as well become one, so collision stays as it is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from scipy.spatial import ConvexHull, QhullError

from pipeline.geometry.facets.separation import ROUNDING_M, ConvexBodies, Facets
from pipeline.volume.mesh_edges import MeshEdges
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume

_PLUMB = 1e-9  # upward part of a normal
# Of a part, whose corners MuJoCo keeps in 32 bits about its middle, and so within 0.01 mm:
# findings/mujoco-mesh-corners-of-32-bits.sh.
LONGEST_M = 100.0
_ACROSS_M = 20.0  # between plumb walls that one prism may be behind
_TOGETHER = 256  # hulls that are tried at once, those with equally many corners together


def merge_parts(volume: Volume, parts: list[ShellPart], longest_m: float = LONGEST_M) -> list[ShellPart]:
    """Return parts of which those are one that have one label and a common hull with nothing of it in the free space.

    Tried are parts whose facets share an edge, and then plumb walls within 20 m of each other: walls of one plane, of
    a nose of rock and on both sides of a pillar become a prism, and a level floor or roof one slab. All corners of a
    part are behind the planes of all its facets, so each facet is covered as before.

    Parameters
    ----------
    volume : Volume
    parts : list of ShellPart
        As `build_shell` returns them.
    longest_m : float
        The greatest extent of a part that is made here along an axis, m.
    """
    merging = _Merging(volume, parts, longest_m)
    merging.merge(_beside(volume, parts))
    merging.merge(_across(volume, merging.parts))
    return sorted((part for part in merging.parts if part), key=lambda part: part.facets[0])


@dataclass(frozen=True)
class _Planes:
    """Planes of facets: unit normals (f, 3) into the rock and offsets (f,) m."""

    normals: np.ndarray
    offsets: np.ndarray

    def have_behind(self, corners: np.ndarray, facets: list[int]) -> bool:
        """Return whether all corners (k, 3) m are behind the planes of some facets."""
        return bool((corners @ self.normals[facets].T - self.offsets[facets]).min() > -ROUNDING_M)


class _Merging:
    """Parts by number; None where one has become a part of an earlier one."""

    def __init__(self, volume: Volume, parts: list[ShellPart], longest_m: float) -> None:
        self.parts: list[ShellPart | None] = list(parts)
        self._facets, self._longest_m = Facets(volume.vertices, volume.faces), longest_m
        offsets = np.einsum("fk,fk->f", self._facets.normals, self._facets.corners[:, 0])
        self._planes = _Planes(self._facets.normals, offsets)

    def merge(self, pairs: np.ndarray) -> None:
        """Merge parts along pairs (n, 2), the first ones first, until no common hull of two is left in the rock."""
        left = dict.fromkeys(map(tuple, np.sort(pairs, axis=1).tolist()))
        failed: set[tuple[int, int]] = set()
        while left:
            tried, used = [], set[int]()
            for pair in list(left):
                if used.isdisjoint(pair):
                    del left[pair]
                    if self._are_behind(*pair):
                        tried.append(pair)
                        used.update(pair)
                    else:
                        failed.add(pair)
            merged = self._merged(tried)
            failed |= {pair for pair in tried if pair[1] not in merged}  # a larger hull fails as well
            failed = {_renamed(pair, merged) for pair in failed}
            left = dict.fromkeys(_renamed(pair, merged) for pair in left)
            left = {pair: None for pair in left if pair[0] != pair[1] and pair not in failed}

    def _are_behind(self, one: int, other: int) -> bool:
        """Return whether the corners of either part are behind the facets of the other."""
        a, b = self._part(one), self._part(other)
        both = np.concatenate([a.corners, b.corners])
        return (
            bool(np.ptp(both, axis=0).max() <= self._longest_m)
            and self._planes.have_behind(a.corners, b.facets)
            and self._planes.have_behind(b.corners, a.facets)
        )

    def _merged(self, pairs: list[tuple[int, int]]) -> dict[int, int]:
        """Merge pairs that share no part where their hulls are in the rock; return the first of each by the second."""
        found: dict[int, int] = {}
        hulls = [
            (pair, hull)
            for pair in pairs
            if (hull := _hull(*(self._part(number).corners for number in pair))) is not None
        ]
        hulls.sort(key=lambda one: len(one[1].vertices))
        for start in range(0, len(hulls), _TOGETHER):
            some = hulls[start : start + _TOGETHER]
            for ((one, other), hull), fits in zip(some, self._fit(some), strict=True):
                if fits:
                    self._join(one, other, hull.points[hull.vertices])
                    found[other] = one
        return found

    def _fit(self, hulls: list[tuple[tuple[int, int], ConvexHull]]) -> list[bool]:
        """Return which hulls of pairs of parts are in the rock: no facet but their own reaches into them."""
        self._facets.owner[:] = -1
        for number, (pair, _) in enumerate(hulls):
            self._facets.owner[[facet for part in map(self._part, pair) for facet in part.facets]] = number
        contacts = self._facets.crossing(_bodies([hull for _, hull in hulls]))
        fits = np.ones(len(hulls), bool)
        fits[contacts.body] = False
        return fits.tolist()

    def _join(self, one: int, other: int, corners: np.ndarray) -> None:
        a, b = self._part(one), self._part(other)
        facets = a.facets + b.facets if a.area_m2 >= b.area_m2 else b.facets + a.facets
        depth = float((corners @ self._planes.normals[facets[0]]).max() - self._planes.offsets[facets[0]])
        self.parts[one] = replace(
            a, corners=corners, facets=facets, shape="merged", depth_m=depth, area_m2=a.area_m2 + b.area_m2
        )
        self.parts[other] = None

    def _part(self, number: int) -> ShellPart:
        part = self.parts[number]
        assert part is not None
        return part


def _hull(one: np.ndarray, other: np.ndarray) -> ConvexHull | None:
    """Return the hull of two parts' corners; None if it has no volume.

    manifold3d's loses corners by up to 0.4 mm: findings/manifold3d-hull-loses-corners.sh.
    """
    try:
        return ConvexHull(np.concatenate([one, other]))
    except QhullError:
        return None


def _bodies(hulls: list[ConvexHull]) -> ConvexBodies:
    """Return hulls as bodies, each with the number of its place in the list."""
    sides = [hull.points[hull.simplices] for hull in hulls]
    edges = [(np.roll(side, -1, axis=1) - side)[:, :2].reshape(-1, 3) for side in sides]  # each is of two triangles
    corners = [hull.points[hull.vertices] for hull in hulls]
    directions = [hull.equations[:, :3] for hull in hulls]
    return ConvexBodies(_padded(corners), _padded(directions), _padded(edges), np.arange(len(hulls)))


def _padded(rows: list[np.ndarray]) -> np.ndarray:
    """Return lists of rows (k, 3) as one array (n, most, 3); shorter ones repeat their last row."""
    most = max(map(len, rows))
    return np.stack([one[np.minimum(np.arange(most), len(one) - 1)] for one in rows])


def _renamed(pair: tuple[int, int], merged: dict[int, int]) -> tuple[int, int]:
    one, other = (merged.get(number, number) for number in pair)
    return (one, other) if one < other else (other, one)


def _beside(volume: Volume, parts: list[ShellPart]) -> np.ndarray:
    """Return the pairs (n, 2) of parts of one label with an edge that is no hollow of the rock, short edges first."""
    owner = np.full(len(volume.faces), -1)
    for number, part in enumerate(parts):
        owner[part.facets] = number
    start, end = volume.faces, np.roll(volume.faces, -1, axis=1)
    beside = MeshEdges.of(volume).facets(end, start)
    facet = np.broadcast_to(np.arange(len(volume.faces))[:, None], beside.shape)
    normals = volume.normals / np.maximum(np.linalg.norm(volume.normals, axis=1, keepdims=True), 1e-30)
    third = volume.vertices[np.roll(volume.faces, -2, axis=1)]  # the corner that is not on the edge
    over = np.einsum("fsk,fsk->fs", third - volume.vertices[start], normals[beside])
    edge = (owner[facet] < owner[beside]) & (owner[facet] >= 0) & (over > -ROUNDING_M)
    edge &= volume.label[facet] == volume.label[beside]
    length = np.linalg.norm(volume.vertices[start] - volume.vertices[end], axis=2)[edge]
    pairs = np.column_stack([owner[facet[edge]], owner[beside[edge]]])
    return pairs[np.argsort(length, kind="stable")]


def _across(volume: Volume, parts: list[ShellPart | None]) -> np.ndarray:
    """Return the pairs (n, 2) of parts behind plumb walls that are near each other, the nearest first."""
    unit = volume.normals[:, 2] / np.maximum(np.linalg.norm(volume.normals, axis=1), 1e-30)
    numbers = [k for k, part in enumerate(parts) if part and (np.abs(unit[part.facets]) < _PLUMB).all()]
    some = [part for part in parts if part and (np.abs(unit[part.facets]) < _PLUMB).all()]
    walls = np.array([shapely.MultiPoint(part.corners[:, :2]).convex_hull for part in some], object)
    one, other = shapely.STRtree(walls).query(walls, predicate="dwithin", distance=_ACROSS_M)
    heights = np.array([[part.corners[:, 2].min(), part.corners[:, 2].max()] for part in some]).reshape(-1, 2)
    label = np.array([volume.label[part.facets[0]] for part in some], int)
    near = (one < other) & (label[one] == label[other])
    near &= (heights[one, 0] < heights[other, 1]) & (heights[other, 0] < heights[one, 1])
    one, other = one[near], other[near]
    order = np.argsort(shapely.distance(walls[one], walls[other]), kind="stable")
    return np.array(numbers, int)[np.column_stack([one, other])[order]]
