"""Closed meshes that do not cross themselves: about facets that cross, the surface is found again on a grid."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from minesurveys.errors import InputError
from pipeline.geometry.facets.crossings import CROSSING_M, crossing_facets
from pipeline.scans.meshes.crossing_regions import rebuilt_within
from pipeline.scans.meshes.winding import WindingNumber

_CELLS = 6.0  # along the median edge of facets that cross
_LEAST_M, _MOST_M = 0.02, 0.2  # of a cell
_FLAT = 0.5  # of a cell, by which the new surface may move when it is simplified; half as far in each round
_LAP_M = 1e-3  # of both surfaces at a box's sides: without, sides that lie on each other left walls of no thickness
_BESIDE_M = 1e-3  # of a facet: the place by which its part is judged
_FOLDED_M, _LEAST_M2 = 1e-4, 1e-6  # of a facet: the places by which its sides are judged, and its area
_ROUNDS = 8  # in each of which the boxes about facets that cross are a cell wider


@dataclass(frozen=True)
class UncrossedMesh:
    """A mesh (n, 3) m, (m, 3), how many facets crossed, at how many places, and the cells of those, m."""

    vertices: np.ndarray
    faces: np.ndarray
    crossed: int
    places: int
    cell_m: float


def uncrossed(vertices: np.ndarray, faces: np.ndarray) -> UncrossedMesh:
    """Return a mesh whose facets do not cross: in boxes about those that do, it bounds what they enclose once or more.

    When none cross, facets that are not between the space and rock are found again once, as those of folds and of walls
    without a thickness. All else keeps its place.

    Parameters
    ----------
    vertices, faces : (n, 3) float64 m, (m, 3) int
        Closed.

    Raises
    ------
    InputError
        If facets still cross after eight rounds. The message names the place.
    """
    pairs = crossing_facets(vertices, faces, CROSSING_M)
    crossed, places, looked, wide = len(np.unique(pairs)), 0, False, 1
    edges = vertices[faces[np.unique(pairs)]]
    size = np.median(np.linalg.norm(edges - np.roll(edges, 1, axis=1), axis=2)) if crossed else 0.0
    cell_m = float(np.clip(size / _CELLS, _LEAST_M, _MOST_M))
    for _ in range(_ROUNDS):
        if not len(pairs) and crossed:
            vertices, faces = _without_doubled(vertices, faces)
            pairs, looked, wide = (pairs if looked else _folded(vertices, faces)), True, 1
        if not len(pairs):
            return UncrossedMesh(vertices, faces, crossed, places, cell_m)
        boxes = _boxes(vertices[faces[pairs]], wide * cell_m)
        places += len(boxes)
        vertices, faces = _found_again(vertices, faces, boxes, cell_m, _FLAT * 0.5 ** (wide - 1) * cell_m)
        wide += 1
        pairs = crossing_facets(vertices, faces, CROSSING_M)
    x, y, z = vertices[faces[pairs[0, 0]]].mean(axis=0)
    raise InputError(
        f"its surface crosses itself at ({x:.1f}, {y:.1f}, {z:.1f}) m; --voxel M finds it at another resolution"
    )


def _folded(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the facets that are not between space behind and rock before them, each as a pair (n, 2) with itself.

    The mesh goes once about space and never about rock; what of them is thinner than 0.1 mm counts as none.
    """
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=1)
    some = np.flatnonzero(size > 2 * _LEAST_M2)
    step = _FOLDED_M * normal[some] / size[some, None]
    winding, middle, line = WindingNumber(vertices, faces), (a + b + c)[some] / 3, np.arange(len(some))
    behind, before = (winding.at(middle + way * step, line, _FOLDED_M) for way in (-1, 1))
    return np.repeat(some[(behind != 1) | (before != 0), None], 2, axis=1)


def _found_again(
    vertices: np.ndarray, faces: np.ndarray, boxes: np.ndarray, cell_m: float, flat_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh of which what is in boxes (k, 2, 3) m is found on a grid, and simplified by `flat_m`."""
    space = manifold_of(vertices, faces)
    inner = manifold_of(*rebuilt_within(vertices, faces, cell_m, boxes)).simplify(flat_m)
    about, within = (
        manifold3d.Manifold.batch_boolean(
            [manifold3d.Manifold.cube(high - low - 2 * less).translate(low + less) for low, high in boxes],
            manifold3d.OpType.Add,
        )
        for less in (0.0, _LAP_M)
    )
    return arrays_of((space - within) + (inner ^ about))


def _without_doubled(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh without its parts about which it goes twice, and those that it goes about the other way."""
    winding, kept = WindingNumber(vertices, faces), list[manifold3d.Manifold]()
    for part in manifold_of(vertices, faces).decompose():
        a, b, c = np.moveaxis(np.take(*arrays_of(part), axis=0), 1, 0)
        normal = np.cross(b - a, c - a)
        size = np.linalg.norm(normal, axis=1)
        k = int(size.argmax())
        beside = (a + b + c)[k] / 3 + _BESIDE_M * normal[k] / size[k]
        if not winding.at(beside[None], np.zeros(1, int), _BESIDE_M).any():
            kept.append(part)
    return arrays_of(manifold3d.Manifold.compose(kept))


def _boxes(crossed: np.ndarray, margin_m: float) -> np.ndarray:
    """Return boxes (k, 2, 3) m about what the boxes of two triangles (n, 2, 3, 3) share; those that meet are one."""
    low, high = crossed.min(axis=2).max(axis=1), crossed.max(axis=2).min(axis=1)
    boxes = np.stack([low - margin_m, high + margin_m], axis=1)
    while True:
        tree = shapely.STRtree(shapely.box(*boxes[:, 0, :2].T, *boxes[:, 1, :2].T))
        one, two = tree.query(tree.geometries)
        meet = (boxes[one, 0, 2] <= boxes[two, 1, 2]) & (boxes[two, 0, 2] <= boxes[one, 1, 2])
        pairs = coo_matrix((meet[meet], (one[meet], two[meet])), (len(boxes), len(boxes)))
        count, part = connected_components(pairs, directed=False)
        if count == len(boxes):
            return boxes
        low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        np.minimum.at(low, part, boxes[:, 0])
        np.maximum.at(high, part, boxes[:, 1])
        boxes = np.stack([low, high], axis=1)


def manifold_of(vertices: np.ndarray, faces: np.ndarray) -> manifold3d.Manifold:
    """Return a closed mesh as the library has it."""
    mesh = manifold3d.Mesh64(np.array(vertices, np.float64, order="C"), faces.astype(np.uint64, order="C"))
    return manifold3d.Manifold(mesh)


def arrays_of(solid: manifold3d.Manifold) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (n, 3) m and faces (m, 3) of a solid."""
    mesh = solid.to_mesh64()
    return np.array(mesh.vert_properties, np.float64, order="C")[:, :3], np.array(mesh.tri_verts, np.int64, order="C")
