"""Faces of convex parts on the planes of facets, and what of the facets they cover."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from pipeline.volume.rock.ragged import PartCorners
from pipeline.volume.separation import Facets
from pipeline.volume.union import Volume

_ON_PLANE_M = 1e-5  # corners of a part's face from the plane of a facet
_INSIDE = 1e-6  # of a part's face, beyond its edges
_WHOLE = 1e-9  # of a facet's area that rounding may leave
_PAIRS = 100_000  # of a part and a facet, tried together


@dataclass(frozen=True)
class PartFaces:
    """Pairs of a part and a facet on whose plane the part has a face with all of the part behind it, by part.

    Attributes
    ----------
    part, facet : (n,) int64
    area_m2 : (n,) float64
        Of the part's face.
    depth_m : (n,) float64
        Of the part's farthest corner behind the plane.
    holds_middle : (n,) bool
        Whether the facet's middle is on the face.
    shared : (n,) shapely.Polygon
        What the face covers of the facet, in the facet's plane.
    """

    part: np.ndarray
    facet: np.ndarray
    area_m2: np.ndarray
    depth_m: np.ndarray
    holds_middle: np.ndarray
    shared: np.ndarray

    def uncovered_m2(self, areas_m2: np.ndarray) -> np.ndarray:
        """Return what (f,) m2 of each facet no part's face covers; `areas_m2` (f,) are those of the facets."""
        most = np.zeros(len(areas_m2))
        np.maximum.at(most, self.facet, shapely.area(self.shared))
        left = np.flatnonzero(most < (1 - _WHOLE) * areas_m2)
        for facet in left[most[left] > 0].tolist():
            most[facet] = shapely.union_all(self.shared[self.facet == facet]).area
        return np.maximum(0.0, areas_m2 - most)


def faces_on_facets(volume: Volume, parts: PartCorners) -> PartFaces:
    """Return the faces of parts that lie on the facets of a volume."""
    facets = Facets(volume.vertices, volume.faces)
    low, high = parts.boxes()
    part, facet = facets.near(low - _ON_PLANE_M, high + _ON_PLANE_M)
    order = np.lexsort((facet, part))
    part, facet = part[order], facet[order]
    middles = facets.corners.mean(axis=1)
    kept, depths = [np.zeros(0, int)], [np.zeros(0)]
    for start in range(0, len(part), _PAIRS):
        p, f = part[start : start + _PAIRS], facet[start : start + _PAIRS]
        rows, starts = parts.rows(p)
        depth = _depths(parts, middles, facets.normals, p, f)
        on = np.add.reduceat((np.abs(depth) < _ON_PLANE_M).astype(int), starts)
        good = np.flatnonzero((np.minimum.reduceat(depth, starts) > -_ON_PLANE_M) & (on > 2))
        kept.append(start + good)
        depths.append(np.maximum.reduceat(depth, starts)[good])
    chosen = np.concatenate(kept)
    part, facet = part[chosen], facet[chosen]
    across = _across(facets.normals[facet])
    rows, starts = parts.rows(part)
    pair = np.repeat(np.arange(len(part)), np.diff(np.append(starts, len(rows))))
    on = np.abs(_depths(parts, middles, facets.normals, part, facet)) < _ON_PLANE_M
    flat = np.einsum("nk,njk->nj", (parts.corners[rows] - middles[facet[pair]])[on], across[pair[on]])
    face = shapely.convex_hull(shapely.multipoints(flat, indices=pair[on]))
    triangle = shapely.polygons(np.einsum("nck,njk->ncj", facets.corners[facet] - middles[facet][:, None], across))
    return PartFaces(
        part,
        facet,
        shapely.area(face),
        np.concatenate(depths),
        shapely.distance(face, shapely.Point(0, 0)) < _INSIDE,
        shapely.intersection(face, triangle),
    )


def _depths(
    parts: PartCorners, middles: np.ndarray, normals: np.ndarray, part: np.ndarray, facet: np.ndarray
) -> np.ndarray:
    """Return how deep (r,) m each corner of some parts is behind the plane of the part's facet."""
    rows, starts = parts.rows(part)
    facets = np.repeat(facet, np.diff(np.append(starts, len(rows))))
    found: np.ndarray = np.einsum("nk,nk->n", parts.corners[rows] - middles[facets], normals[facets])
    return found


def _across(normals: np.ndarray) -> np.ndarray:
    """Return two unit vectors (n, 2, 3) across each unit normal."""
    first = np.cross(normals, np.eye(3)[np.argmin(np.abs(normals), axis=1)])
    first /= np.maximum(np.sqrt((first**2).sum(axis=1, keepdims=True)), 1e-30)
    return np.stack([first, np.cross(normals, first)], axis=1)
