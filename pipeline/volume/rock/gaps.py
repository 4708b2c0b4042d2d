"""The widest circle on the surface of the free space behind which there is no rock, or only thin rock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.geometry.facets.separation import Facets
from pipeline.volume.rock.faces import GRID_M, PartFaces, across

_LEAST_M = 1e-5  # radius of a piece that is left out
_ROUGH_M = 5e-4  # a larger radius is found exactly
_EXACT_M = 1e-4
_BESIDE_M = 1e-4  # pieces that are so near are one gap
_MOST_PIECES = 2000  # of a gap that are compared with each other: 4 million distances
_ROUNDS = 20


@dataclass(frozen=True)
class SurfaceGap:
    """The diameter of a circle, m, that is at least as wide as any that fits into a gap, and where (3,) m it is."""

    width_m: float
    place_m: np.ndarray


def widest_gap(facets: Facets, faces: PartFaces, least_depth_m: float = 0.0) -> SurfaceGap:
    """Return the widest gap between the faces of parts that reach at least so deep behind their facets.

    What no face covers of a facet is in pieces. A disc that is covered by convex sets has at most the sum of the radii
    of the largest discs in these (Kadets 2005), so pieces that touch each other count with their sum, as far as one
    disc reaches.

    References
    ----------
    Kadets 2005, Proc. AMS 133(5), doi:10.1090/S0002-9939-04-07650-6
    """
    pieces, owner, radius = _pieces(facets, faces.some(faces.depth_m >= least_depth_m))
    found = SurfaceGap(0.0, facets.corners[0].mean(axis=0))
    if not len(pieces):
        return found
    low, high = _boxes(facets, pieces, owner)
    one, other = _near(low - _BESIDE_M, high + _BESIDE_M)
    _, gap = connected_components(coo_matrix((np.ones(len(one)), (one, other)), (len(pieces),) * 2), directed=False)
    total = np.bincount(gap, radius)
    order = np.argsort(gap, kind="stable")
    members = np.split(order, np.searchsorted(gap[order], np.arange(1, len(total))))
    for number in np.argsort(-total).tolist():
        if 2 * total[number] <= found.width_m:
            break
        at = members[number]
        width_m = 2 * _disc_m(low[at], high[at], radius[at])
        if width_m > found.width_m:
            found = SurfaceGap(width_m, (low + high)[at[radius[at].argmax()]] / 2)
    return found


def _disc_m(low: np.ndarray, high: np.ndarray, radius: np.ndarray) -> float:
    """Return a radius, m, that no disc on pieces in boxes exceeds: it meets none farther apart than it is wide."""
    found = float(radius.sum())
    if len(radius) > _MOST_PIECES:
        return found
    apart = np.maximum(low[:, None] - high[None], low[None] - high[:, None]).clip(0)
    distance = np.linalg.norm(apart, axis=2)
    for _ in range(_ROUNDS):
        found = float(((distance <= 2 * found) @ radius).max())
    return found


def _pieces(facets: Facets, faces: PartFaces) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the pieces (n,) that no face covers, in the planes of their facets (n,), and their radii (n,) m.

    The area that is left bounds a radius as well: a difference may lose what the union has.
    """
    bare_m2 = faces.uncovered_m2(facets.areas_m2)
    bare = np.flatnonzero(bare_m2 > np.pi * _LEAST_M**2)
    middles = facets.corners[bare].mean(axis=1)
    flat = np.einsum("nck,njk->ncj", facets.corners[bare] - middles[:, None], across(facets.normals[bare]))
    covered = np.array([_union(some) for some in faces.covering(bare)], object)
    left = shapely.difference(shapely.polygons(flat), covered, grid_size=GRID_M)
    pieces, at = shapely.get_parts(left, return_index=True)
    kept = shapely.area(pieces) > 0
    pieces, at = pieces[kept], at[kept]
    most = np.sqrt(bare_m2[bare[at]] / np.pi)
    return pieces, bare[at], np.minimum(most, np.array([_radius_m(piece) for piece in pieces] + [0.0])[:-1])


def _union(polygons: np.ndarray) -> shapely.MultiPolygon:
    """Return the union of polygons, without the lines to which some of them shrink on the grid."""
    parts = shapely.get_parts(shapely.union_all(polygons, grid_size=GRID_M))
    return shapely.multipolygons(parts[shapely.get_dimensions(parts) == 2])


def _radius_m(piece: shapely.Polygon) -> float:
    """Return a radius, m, that is no smaller than that of the largest disc in a polygon, and at most 0.5 mm larger."""
    box = shapely.get_coordinates(shapely.minimum_rotated_rectangle(piece))
    sides = np.linalg.norm(np.diff(box[:3], axis=0), axis=1) if len(box) > 3 else np.zeros(1)
    found = min(np.sqrt(piece.area / np.pi), float(sides.min()) / 2)
    if found > _ROUGH_M:
        found = min(found, float(shapely.maximum_inscribed_circle(piece, _EXACT_M).length) + _EXACT_M)
    return float(found)


def _boxes(facets: Facets, pieces: np.ndarray, owner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest coordinates (n, 3) m of pieces of facets, which are given in their planes."""
    flat, of_piece = shapely.get_coordinates(pieces, return_index=True)
    facet = owner[of_piece]
    places = facets.corners[facet].mean(axis=1) + np.einsum("nj,njk->nk", flat, across(facets.normals[facet]))
    starts = np.flatnonzero(np.diff(of_piece, prepend=-1))
    return np.minimum.reduceat(places, starts), np.maximum.reduceat(places, starts)


def _near(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs of boxes, from `low` to `high` (n, 3) m, that meet."""
    plan = shapely.box(*low[:, :2].T, *high[:, :2].T)
    one, other = shapely.STRtree(plan).query(plan)
    meets = (low[one, 2] <= high[other, 2]) & (low[other, 2] <= high[one, 2])
    return one[meets], other[meets]
