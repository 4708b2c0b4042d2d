"""Closed pieces from triangles: welded, parted, turned outwards, and holes filled."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
from scipy.spatial import cKDTree

from minesurveys.errors import InputError
from minesurveys.solids.polygons import cut_by_ears
from pipeline.survey.solids.pieces import edges_of, joined_by_edges, part_pieces

_LEAST_M2 = 1e-12  # twice a triangle's area
_SAME = 0.1  # of the distance within which corners are one: in a denser mesh pairs would be too many
LEAST_M3 = 1e-3  # of a solid: smaller ones are crumbs of a mesh
_ENCLOSES_NONE = "its triangles enclose no space; --voxel M reads them as a scan, and bridges gaps of M metres"


@dataclass(frozen=True)
class Hole:
    """A hole that was filled: its middle, and the length of its edge, m."""

    middle_m: tuple[float, float, float]
    edge_m: float


@dataclass(frozen=True)
class ClosedPieces:
    """Closed pieces of a mesh, turned outwards, and what was done to close them.

    `outwards` (n,) is which of their normals pointed out of them before, `flipped` counts the triangles that were
    turned the other way than their neighbours. `dropped_m2` is the area of `dropped` pieces that enclose nothing, or
    too little.
    """

    solids: list[manifold3d.Manifold]
    outwards: np.ndarray
    holes: list[Hole]
    dropped: int
    dropped_m2: float
    flipped: int


def close_pieces(vertices: np.ndarray, faces: np.ndarray, weld_m: float, largest_hole_m: float) -> ClosedPieces:
    """Return the closed pieces of a mesh, which may share faces, edges and corners.

    Corners nearer than `weld_m` are one. Holes are filled, up to the width `largest_hole_m`.

    Parameters
    ----------
    vertices : (n, 3) float64, m
    faces : (m, 3) int64
        In the file's order.
    weld_m, largest_hole_m : float

    Raises
    ------
    InputError
        If a hole is wider, or nothing is enclosed. The message names the place of the largest hole.
    """
    vertices, faces = _welded(vertices, faces, weld_m)
    vertices, faces, flipped = part_pieces(vertices, faces)
    faces = _two_a_side(faces, len(vertices))
    if not len(faces):
        raise InputError(_ENCLOSES_NONE)
    solids, outwards, holes, dropped, dropped_m2 = [], [], [], 0, 0.0
    wide: list[Hole] = []
    for some in _pieces(faces, len(vertices)):
        closed, filled = _filled(vertices, some)
        volume = _signed_m3(vertices, closed)
        if abs(volume) < LEAST_M3:
            dropped, dropped_m2 = dropped + 1, dropped_m2 + _area_m2(vertices, some)
            continue
        wide += [hole for hole in filled if hole.edge_m > np.pi * largest_hole_m]
        holes += filled
        solid = _manifold(vertices, closed if volume > 0 else closed[:, ::-1])
        if solid.status() == manifold3d.Error.NoError and not solid.is_empty():
            solids.append(solid)
            outwards.append(volume > 0)
    if wide:
        worst = max(wide, key=lambda hole: hole.edge_m)
        x, y, z = worst.middle_m
        raise InputError(
            f"a hole {worst.edge_m / np.pi:.2f} m wide at ({x:.1f}, {y:.1f}, {z:.1f}) m and {len(wide) - 1} others are "
            f"over {largest_hole_m:g} m; --close M fills holes up to M metres"
        )
    if not solids:
        raise InputError(_ENCLOSES_NONE)
    return ClosedPieces(solids, np.array(outwards), holes, dropped, dropped_m2, flipped)


def _manifold(vertices: np.ndarray, faces: np.ndarray) -> manifold3d.Manifold:
    used, numbers = np.unique(faces, return_inverse=True)
    return manifold3d.Manifold(manifold3d.Mesh64(vertices[used], numbers.reshape(-1, 3).astype(np.uint64)))


def _welded(vertices: np.ndarray, faces: np.ndarray, weld_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices, and triangles with an area between those of them that are no nearer to each other than `weld_m`.

    Other corners become one of these that is so near. Corners in one cell of a tenth of it count as one.
    """
    cells = np.round((vertices - vertices.min(axis=0)) / (_SAME * weld_m))
    _, first, number = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    vertices, into = vertices[first], np.arange(len(first))
    near = cKDTree(vertices).query_pairs(weld_m, output_type="ndarray")
    while len(near):  # a corner stays if no earlier one that may stay is near it
        stays, gone = np.ones(len(first), bool), np.zeros(len(first), bool)
        stays[near[:, 1]] = False
        joined = near[stays[near[:, 0]]]
        into[joined[:, 1]], gone[joined[:, 1]] = joined[:, 0], True
        near = near[~gone[near].any(axis=1)]
    faces = into[number.reshape(-1)][faces]
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return vertices, faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > _LEAST_M2]


def _two_a_side(faces: np.ndarray, count: int) -> np.ndarray:
    """Return the triangles without those at an edge that more than two share."""
    number, _, triangle = edges_of(faces, count)
    crowded = np.bincount(number)[number] > 2
    return np.delete(faces, np.unique(triangle[crowded]), axis=0)


def _pieces(faces: np.ndarray, count: int) -> list[np.ndarray]:
    """Return the triangles of each piece that is joined by edges."""
    part = joined_by_edges(faces, count)
    order = np.argsort(part, kind="stable")
    return [faces[rows] for rows in np.split(order, np.cumsum(np.bincount(part))[:-1])]


def _filled(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, list[Hole]]:
    """Return the triangles with all holes filled, and the holes."""
    made, holes = [faces], []
    for loop in _boundary(faces, len(vertices)):
        corners = vertices[loop]
        made.append(loop[cut_by_ears(corners)])
        edge = float(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1).sum())
        x, y, z = corners.mean(axis=0).tolist()
        holes.append(Hole((x, y, z), edge))
    return np.concatenate(made), holes


def _boundary(faces: np.ndarray, count: int) -> list[np.ndarray]:
    """Return the rings of corners of the edges with one triangle, the other way than that goes."""
    number, _, _ = edges_of(faces, count)
    alone = np.bincount(number)[number] == 1
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])[alone]
    following: dict[int, list[int]] = {}
    for start, end in ends[:, ::-1].tolist():
        following.setdefault(start, []).append(end)
    rings = []
    while following:
        start = next(iter(following))
        ring, at = [start], _take(following, start)
        while at != start and at in following:
            if at in ring:  # two holes touch in a corner: the part of the ring behind it is one
                k = ring.index(at)
                rings.append(np.array(ring[k:]))
                ring = ring[:k]
            ring.append(at)
            at = _take(following, at)
        rings.append(np.array(ring))
    return [ring for ring in rings if len(ring) > 2]


def _take(following: dict[int, list[int]], corner: int) -> int:
    found = following[corner].pop()
    if not following[corner]:
        del following[corner]
    return found


def _signed_m3(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = np.moveaxis(vertices[faces] - vertices[faces[0, 0]], 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def _area_m2(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
