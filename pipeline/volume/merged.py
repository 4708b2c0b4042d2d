"""Fewer parts of the rock: parts whose common hull is in the rock as well become one, so collision stays as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from scipy.spatial import ConvexHull, QhullError

from pipeline.geometry.facets.separation import ROUNDING_M, ConvexBodies, Facets
from pipeline.volume.mesh_edges import MeshEdges, ranges
from pipeline.volume.rock.polygons import LONGEST_M
from pipeline.volume.rock.ragged import parts_of
from pipeline.volume.rock.shapes import padded
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume

_PLUMB = 1e-9  # upward part of a normal
_ACROSS_M = 20.0  # between plumb walls that one prism may be behind
_PRODUCTS = 1_000_000  # of corners and planes at once
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


class _Merging:
    """Parts by number; None where one has become a part of an earlier one."""

    def __init__(self, volume: Volume, parts: list[ShellPart], longest_m: float) -> None:
        self.parts: list[ShellPart | None] = list(parts)
        self._facets, self._longest_m = Facets(volume.vertices, volume.faces), longest_m
        self._offsets = np.einsum("fk,fk->f", self._facets.normals, self._facets.corners[:, 0])

    def merge(self, pairs: np.ndarray) -> None:
        """Merge parts along pairs (n, 2), the first ones first, until no common hull of two is left in the rock."""
        count = len(self.parts)
        left, failed, is_new = _distinct(pairs, count), np.zeros((0, 2), int), np.ones(count, bool)
        while len(left):
            asked = np.flatnonzero(is_new[left].any(axis=1))
            left = np.delete(left, asked[~self._are_behind(left[asked])], axis=0)
            tried, used = list[tuple[int, int]](), bytearray(count)
            for one, other in left.tolist():
                if not (used[one] or used[other]):
                    used[one] = used[other] = True
                    tried.append((one, other))
            number = np.arange(count)
            is_new[:] = False
            for one, other in self._merged(tried):
                number[other], is_new[one] = one, True
            failed = np.concatenate([failed, np.array(tried, int).reshape(-1, 2)])  # a larger hull fails as well
            left, failed = (_distinct(number[some], count) for some in (left, failed))
            left = left[~np.isin(left @ [count, 1], failed @ [count, 1])]

    def _are_behind(self, pairs: np.ndarray) -> np.ndarray:
        """Return of which pairs (n, 2) the corners of either part are behind the facets of the other."""
        numbers, place = np.unique(pairs, return_inverse=True)
        one, other = place.reshape(-1, 2).T
        some = [self._part(number) for number in numbers.tolist()]
        parts = parts_of([part.corners for part in some])
        facets = np.array([facet for part in some for facet in part.facets], int)
        first = np.cumsum([0, *(len(part.facets) for part in some)])
        low, high = parts.boxes_m
        size = np.maximum(high[one], high[other]) - np.minimum(low[one], low[other])
        found: np.ndarray = (size <= self._longest_m).all(axis=1)
        for ours, theirs in ((one, other), (other, one)):
            left = np.flatnonzero(found)
            count = (np.diff(parts.first)[ours] * np.diff(first)[theirs])[left]
            for rows in np.split(left, np.flatnonzero(np.diff(np.cumsum(count) // _PRODUCTS)) + 1):
                of_row, at = ranges(first[theirs[rows]], first[theirs[rows] + 1])
                of_facet, corner = ranges(parts.first[ours[rows]][of_row], parts.first[ours[rows] + 1][of_row])
                facet = facets[at][of_facet]
                over = np.einsum("nk,nk->n", parts.corners[corner], self._facets.normals[facet])
                found[rows[of_row[of_facet[over - self._offsets[facet] <= -ROUNDING_M]]]] = False
        return found

    def _merged(self, pairs: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Merge pairs that share no part where their hulls are in the rock; return these."""
        found = []
        hulls = [
            (pair, hull)
            for pair in pairs
            if (hull := _hull(*(self._part(number).corners for number in pair))) is not None
        ]
        hulls.sort(key=lambda one: len(one[1].vertices))
        for start in range(0, len(hulls), _TOGETHER):
            some = hulls[start : start + _TOGETHER]
            for (pair, hull), fits in zip(some, self._fit(some), strict=True):
                if fits:
                    self._join(*pair, hull.points[hull.vertices])
                    found.append(pair)
        return found

    def _fit(self, hulls: list[tuple[tuple[int, int], ConvexHull]]) -> list[bool]:
        """Return which hulls of pairs of parts are in the rock: no facet but their own reaches into them."""
        self._facets.owner[:] = -1
        for number, (pair, _) in enumerate(hulls):
            self._facets.owner[[facet for part in map(self._part, pair) for facet in part.facets]] = number
        contacts = self._facets.crossing(_bodies([hull for _, hull in hulls]), ROUNDING_M)
        fits = np.ones(len(hulls), bool)
        fits[contacts.body] = False
        return fits.tolist()

    def _join(self, one: int, other: int, corners: np.ndarray) -> None:
        a, b = self._part(one), self._part(other)
        facets = a.facets + b.facets if a.area_m2 >= b.area_m2 else b.facets + a.facets
        depth = float((corners @ self._facets.normals[facets[0]]).max() - self._offsets[facets[0]])
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
    sizes = np.array([len(hull.simplices) for hull in hulls])
    sides = np.concatenate([hull.points[hull.simplices] for hull in hulls])
    return ConvexBodies(
        padded(
            np.concatenate([hull.points[hull.vertices] for hull in hulls]),
            np.array([len(hull.vertices) for hull in hulls]),
        ),
        padded(np.concatenate([hull.equations[:, :3] for hull in hulls]), sizes),
        padded(np.diff(sides, axis=1).reshape(-1, 3), 2 * sizes),  # each edge is of two triangles
        np.arange(len(hulls)),
    )


def _distinct(pairs: np.ndarray, count: int) -> np.ndarray:
    """Return each pair (n, 2) of two of so many numbers once, the smaller number first, in the order of the first."""
    pairs = np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1)
    found: np.ndarray = pairs[np.sort(np.unique(pairs @ [count, 1], return_index=True)[1])]
    return found


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
    is_plumb = np.abs(unit) < _PLUMB
    numbers = [k for k, part in enumerate(parts) if part and is_plumb[part.facets].all()]
    some = [part for part in map(parts.__getitem__, numbers) if part]
    walls = np.array([shapely.MultiPoint(part.corners[:, :2]).convex_hull for part in some], object)
    west, south, east, north = shapely.bounds(walls).reshape(-1, 4).T
    about = shapely.box(west - _ACROSS_M, south - _ACROSS_M, east + _ACROSS_M, north + _ACROSS_M)
    one, other = shapely.STRtree(walls).query(about)
    heights = np.array([[part.corners[:, 2].min(), part.corners[:, 2].max()] for part in some]).reshape(-1, 2)
    label = np.array([volume.label[part.facets[0]] for part in some], int)
    near = (one < other) & (label[one] == label[other])
    near &= (heights[one, 0] < heights[other, 1]) & (heights[other, 0] < heights[one, 1])
    one, other = one[near], other[near]
    apart_m = shapely.distance(walls[one], walls[other])
    near = np.flatnonzero(apart_m <= _ACROSS_M)
    order = near[np.argsort(apart_m[near], kind="stable")]
    return np.array(numbers, int)[np.column_stack([one, other])[order]]
