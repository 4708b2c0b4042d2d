"""Faces of convex parts on the planes of facets, and what of the facets they cover."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely

from minexplore.floors.volume_arrays import Parts
from pipeline.geometry.facets.separation import Facets
from pipeline.volume.rock.ragged import rows_of
from pipeline.volume.union import Volume

ON_PLANE_M = 1e-5  # corners of a part's face from the plane of a facet
_INSIDE = 1e-6  # of a part's face, beyond its edges
_WHOLE = 1e-9  # of a facet's area that rounding may leave
_LEAST_M2 = 1e-9  # of a facet: what is left of smaller ones is rounding
_ON_EDGE_M = 1e-10  # a facet's corner that is so little outside a part's face is on its edge: rounding is 1e-13
# Of corners: without a grid GEOS 3.14 loses polygons whose edges differ in the last digit:
# findings/shapely-like-triangles-share-nothing.sh.
GRID_M = 1e-9
_PAIRS = 100_000  # of a part and a facet, tried together
_AT_ONCE = 20_000  # parts or facets


@dataclass(frozen=True)
class PartFaces:
    """Pairs of a part and a facet on whose plane the part has a face with all of the part behind it.

    Attributes
    ----------
    part, facet : (n,) int64
    area_m2 : (n,) float64
        Of the part's face; 0 where it is on the plane of another facet, which this one is near.
    depth_m : (n,) float64
        Of the part's farthest corner behind the plane.
    shared : (n,) shapely.Polygon
        What the face covers of the facet, in the facet's plane and along its normal; nothing where another face covers
        all of that facet.
    """

    part: np.ndarray
    facet: np.ndarray
    area_m2: np.ndarray
    depth_m: np.ndarray
    shared: np.ndarray

    def largest(self, count: int) -> np.ndarray:
        """Return for each of `count` parts the pair with its largest face, the first of equals; -1 if it has none."""
        order = np.lexsort((self.facet, -self.area_m2, self.part))
        number, first = np.unique(self.part[order], return_index=True)
        found = np.full(count, -1)
        found[number] = order[first]
        return found

    def joined(self, more: PartFaces) -> PartFaces:
        """Return these and more pairs."""
        return PartFaces(
            *(np.concatenate([a, b]) for a, b in zip(vars(self).values(), vars(more).values(), strict=True))
        )

    def some(self, chosen: np.ndarray) -> PartFaces:
        """Return the pairs that are chosen."""
        return PartFaces(*(column[chosen] for column in vars(self).values()))

    def covering(self, facets: np.ndarray) -> list[np.ndarray]:
        """Return what the faces cover of each of some facets (n,), as polygons in its plane."""
        order = np.argsort(self.facet, kind="stable")
        first, end = (np.searchsorted(self.facet[order], facets, side) for side in ("left", "right"))
        return [self.shared[order[a:b]] for a, b in zip(first.tolist(), end.tolist(), strict=True)]

    def uncovered_m2(self, areas_m2: np.ndarray) -> np.ndarray:
        """Return what (f,) m2 of each facet no part's face covers; `areas_m2` (f,) are those of the facets."""
        most = np.zeros(len(areas_m2))
        np.maximum.at(most, self.facet, shapely.area(self.shared))
        left = np.flatnonzero((most > 0) & (most < (1 - _WHOLE) * areas_m2))
        most[left] = [shapely.union_all(some, grid_size=GRID_M).area for some in self.covering(left)]
        return np.maximum(0.0, areas_m2 - most)


def faces_on_facets(volume: Volume, parts: Parts) -> PartFaces:
    """Return the faces of parts that lie on the facets of a volume.

    The plane of a small facet is known badly far from it. What no face covers is tried again with the plane of each
    part's largest face.
    """
    facets = Facets(volume.vertices, volume.faces)
    near, chosen = _near(facets, parts)
    part, facet = near[0][chosen], near[1][chosen]
    found = _faces(facets, parts, part, facet, facet)
    size = np.linalg.norm(volume.normals, axis=1) / 2
    bare = found.uncovered_m2(size) > _WHOLE * np.maximum(size, _LEAST_M2)
    front = found.largest(len(parts))
    again = np.flatnonzero(bare[near[1]] & (front[near[0]] >= 0))
    part, facet = near[0][again], near[1][again]
    plane = found.facet[front[part]]
    off = np.einsum("nck,nk->nc", facets.corners[facet] - facets.corners[plane][:, :1], facets.normals[plane])
    on = (np.abs(off).max(axis=1) < ON_PLANE_M) & (plane != facet)
    more = _faces(facets, parts, part[on], plane[on], facet[on])
    return found.joined(replace(more, area_m2=np.zeros(len(more.part))))


def _near(facets: Facets, parts: Parts) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs (2, n) of a part and a facet that are near each other, and which of them `_lie_behind` finds."""
    low, high = parts.boxes_m
    pairs, behind = [np.zeros((2, 0), int)], [np.zeros(0, bool)]
    for start in range(0, len(parts), _AT_ONCE):
        rows = slice(start, start + _AT_ONCE)
        part, facet = facets.near(low[rows] - ON_PLANE_M, high[rows] + ON_PLANE_M)
        part += start
        pairs.append(np.stack([part, facet]))
        for first in range(0, len(part), _PAIRS):
            some = slice(first, first + _PAIRS)
            behind.append(_lie_behind(facets, parts, part[some], facet[some]))
    return np.concatenate(pairs, axis=1), np.flatnonzero(np.concatenate(behind))


def _lie_behind(facets: Facets, parts: Parts, part: np.ndarray, facet: np.ndarray) -> np.ndarray:
    """Return which parts (n,) lie behind the planes of facets with a face on it."""
    depth, starts = _depths(facets, parts, part, facet), rows_of(parts, part)[1]
    on = np.add.reduceat((np.abs(depth) < ON_PLANE_M).astype(int), starts)
    found: np.ndarray = (np.minimum.reduceat(depth, starts) > -ON_PLANE_M) & (on > 2)
    return found


def _faces(facets: Facets, parts: Parts, part: np.ndarray, plane: np.ndarray, facet: np.ndarray) -> PartFaces:
    """Return the faces of parts on the planes of some facets, and what they cover of others along their normals."""
    order = np.argsort(facet, kind="stable")
    first = np.append(np.flatnonzero(np.diff(facet[order], prepend=-1)), len(order))

    area, depth = np.zeros(len(part)), np.zeros(len(part))
    shared = np.full(len(part), shapely.Polygon(), object)
    for start in range(0, len(first) - 1, _AT_ONCE):
        rows = np.sort(order[first[start] : first[min(start + _AT_ONCE, len(first) - 1)]])
        area[rows], depth[rows], shared[rows] = _faces_of(facets, parts, part[rows], plane[rows], facet[rows])
    return PartFaces(part, facet, area, depth, shared)


def _faces_of(
    facets: Facets, parts: Parts, part: np.ndarray, plane: np.ndarray, facet: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return the last columns of `PartFaces`."""
    ways, middles = across(facets.normals[facet]), facets.corners[facet].mean(axis=1)
    rows, starts = rows_of(parts, part)
    pair = np.repeat(np.arange(len(part)), np.diff(np.append(starts, len(rows))))
    depth = _depths(facets, parts, part, plane)
    on = np.abs(depth) < ON_PLANE_M
    flat = np.einsum("nk,njk->nj", (parts.corners[rows] - middles[pair])[on], ways[pair[on]])
    face = shapely.convex_hull(shapely.multipoints(flat, indices=pair[on]))
    corners = np.einsum("nck,njk->ncj", facets.corners[facet] - middles[:, None], ways)
    shared = np.full(len(part), shapely.Polygon(), object)
    whole = shapely.distance(face, shapely.Point(0, 0)) < _INSIDE
    for corner in range(3):
        near = np.flatnonzero(whole)
        whole[near] = shapely.dwithin(face[near], shapely.points(corners[near, corner]), _ON_EDGE_M)
    shared[whole] = shapely.polygons(corners[whole])
    left = np.flatnonzero(~np.isin(facet, facet[whole]))
    shared[left] = polygons_shared(face[left], shapely.polygons(corners[left]))
    return shapely.area(face), np.maximum.reduceat(depth, starts), shared


def polygons_shared(some: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return what each of some polygons (n,) shares with the other of its number, also where GEOS first loses it."""
    shared: np.ndarray = shapely.intersection(some, others)
    lost = np.flatnonzero(shapely.area(shared) <= 0)
    lost = lost[shapely.intersects(some[lost], others[lost])]  # or they only touch
    shared[lost] = shapely.intersection(some[lost], others[lost], grid_size=GRID_M)
    return shared


def _depths(facets: Facets, parts: Parts, part: np.ndarray, facet: np.ndarray) -> np.ndarray:
    """Return how deep (r,) m each corner of some parts is behind the plane of the part's facet."""
    rows, starts = rows_of(parts, part)
    number = np.repeat(facet, np.diff(np.append(starts, len(rows))))
    found: np.ndarray = np.einsum("nk,nk->n", parts.corners[rows] - facets.corners[number, 0], facets.normals[number])
    return found


def across(normals: np.ndarray) -> np.ndarray:
    """Return two unit vectors (n, 2, 3) across each unit normal: those of a facet's plane, from its middle."""
    first = np.cross(normals, np.eye(3)[np.argmin(np.abs(normals), axis=1)])
    first /= np.maximum(np.sqrt((first**2).sum(axis=1, keepdims=True)), 1e-30)
    return np.stack([first, np.cross(normals, first)], axis=1)
