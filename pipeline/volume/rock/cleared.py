"""Which convex parts planes keep out of the free space; the others are to be measured by booleans."""

from __future__ import annotations

import manifold3d
import numpy as np

from pipeline.volume.rock.ragged import PartCorners
from pipeline.volume.rock.shapes import bodies_of
from pipeline.volume.separation import ROUNDING_M, Facets
from pipeline.volume.union import Volume

_PAIRS = 100_000  # tried together
_TOGETHER = 1000  # bodies


def parts_not_cleared(volume: Volume, parts: PartCorners, outward: np.ndarray) -> np.ndarray:
    """Return the numbers of the parts that some facet reaches into, as far as planes tell.

    `outward` (n, 3) are unit normals of the parts' faces on the free space, out of the part. First tried are these, the
    facets' planes and the planes across the way from middle to middle; then all there is of planes that separate two
    convex bodies.
    """
    facets = Facets(volume.vertices, volume.faces)
    left = _quickly(facets, parts, outward)
    found = [np.zeros(0, int)]
    for start in range(0, len(left), _TOGETHER):
        some = left[start : start + _TOGETHER]
        solids = [manifold3d.Manifold.hull_points(parts[k]) for k in some.tolist()]
        fronts = np.array([parts[k][:3] for k in some.tolist()])
        bodies = bodies_of(solids, fronts, outward[some], np.full(len(some), -1))
        found.append(some[np.unique(facets.crossing(bodies).body)])
    return np.concatenate(found)


def _quickly(facets: Facets, parts: PartCorners, outward: np.ndarray) -> np.ndarray:
    """Return the numbers of the parts that the first planes do not separate from some facet."""
    middles = np.add.reduceat(parts.corners, parts.first[:-1]) / np.diff(parts.first)[:, None]
    part, facet = facets.near(*parts.boxes())
    found = [np.zeros(0, int)]
    for start in range(0, len(part), _PAIRS):
        p, f = part[start : start + _PAIRS], facet[start : start + _PAIRS]
        for ways in (
            lambda p, f: outward[p],
            lambda p, f: -facets.normals[f],
            lambda p, f: facets.normals[f],
            lambda p, f: _units(facets.corners[f].mean(axis=1) - middles[p]),
        ):
            meets = _overlap(facets.corners, parts, p, f, ways(p, f)) > ROUNDING_M
            p, f = p[meets], f[meets]
        found.append(p)
    return np.unique(np.concatenate(found))


def _overlap(
    corners: np.ndarray, parts: PartCorners, part: np.ndarray, facet: np.ndarray, ways: np.ndarray
) -> np.ndarray:
    """Return how far (n,) m parts reach beyond the nearest corner of facets (f, 3, 3) along ways (n, 3)."""
    if not len(part):
        return np.zeros(0)
    rows, starts = parts.rows(part)
    along = np.einsum("nk,nk->n", parts.corners[rows], np.repeat(ways, np.diff(np.append(starts, len(rows))), axis=0))
    facets = corners[facet]
    least = np.minimum(*(np.einsum("nk,nk->n", facets[:, k], ways) for k in (0, 1)))
    found: np.ndarray = np.maximum.reduceat(along, starts)
    return found - np.minimum(least, np.einsum("nk,nk->n", facets[:, 2], ways))


def _units(vectors: np.ndarray) -> np.ndarray:
    found: np.ndarray = vectors / np.maximum(np.sqrt((vectors**2).sum(axis=1, keepdims=True)), 1e-30)
    return found
