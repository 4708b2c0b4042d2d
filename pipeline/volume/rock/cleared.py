"""Which convex parts planes keep out of the free space; the others are to be measured."""

from __future__ import annotations

import manifold3d
import numpy as np

from minexplore.floors.volume_arrays import Parts
from pipeline.geometry.facets.separation import ROUNDING_M, Facets
from pipeline.volume.rock.ragged import middles_of, rows_of
from pipeline.volume.rock.shapes import bodies_of
from pipeline.volume.union import Volume

_PAIRS = 100_000  # tried together
_TOGETHER = 1000  # bodies
_AT_ONCE = 20_000  # parts whose facets are looked for together


def parts_not_cleared(volume: Volume, parts: Parts, outward: np.ndarray) -> np.ndarray:
    """Return the numbers of the parts that some facet reaches into, as far as planes show.

    `outward` (n, 3) are unit normals of the parts' faces on the free space, out of the part. First tried are these, the
    facets' planes and the planes across the way from middle to middle; then all there is of planes that separate two
    convex bodies.
    """
    facets = Facets(volume.vertices, volume.faces)
    count = np.diff(parts.first)
    along = np.einsum("nk,nk->n", parts.corners, np.repeat(outward, count, axis=0))
    reach = np.maximum.reduceat(along, parts.first[:-1])
    middles = middles_of(parts)
    low, high = parts.boxes_m

    pairs = [np.zeros((2, 0), int)]
    for start in range(0, len(parts), _AT_ONCE):
        part, facet = facets.near(low[start : start + _AT_ONCE], high[start : start + _AT_ONCE])
        pairs.append(np.stack(_not_parted(facets, parts, outward, reach, middles, part + start, facet)))
    return _in_full(facets, parts, outward, *np.concatenate(pairs, axis=1))


def _in_full(facets: Facets, parts: Parts, outward: np.ndarray, part: np.ndarray, facet: np.ndarray) -> np.ndarray:
    """Return which of the parts of some pairs (n,) of a part and a facet no plane separates from one of its facets."""
    left, body = np.unique(part, return_inverse=True)
    order = np.argsort(body, kind="stable")
    starts = np.searchsorted(body[order], np.arange(0, len(left) + _TOGETHER, _TOGETHER))
    found = [np.zeros(0, int)]
    for number, rows in enumerate(map(slice, starts[:-1], starts[1:])):
        start = _TOGETHER * number
        some = left[start : start + _TOGETHER]
        solids = [manifold3d.Manifold.hull_points(parts[k]) for k in some.tolist()]
        fronts = np.array([parts[k][:3] for k in some.tolist()])
        bodies = bodies_of(solids, fronts, outward[some], np.full(len(some), -1))
        pairs = facets.crossing_pairs(bodies, body[order[rows]] - start, facet[order[rows]])
        found.append(some[np.unique(pairs.body)])
    return np.concatenate(found)


def _not_parted(
    facets: Facets,
    parts: Parts,
    outward: np.ndarray,
    reach: np.ndarray,
    middles: np.ndarray,
    part: np.ndarray,
    facet: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return those pairs of a part (n,) and a facet (n,) that the first planes do not separate, by their numbers.

    `reach` (p,) m is how far the parts reach outward, `middles` (p, 3) m are those of their corners.
    """
    found = [(part[:0], facet[:0])]
    for start in range(0, len(part), _PAIRS):
        p, f = part[start : start + _PAIRS], facet[start : start + _PAIRS]
        meets = reach[p] - _least(facets.corners[f], outward[p]) > ROUNDING_M
        p, f = p[meets], f[meets]
        normal = facets.normals[f]
        low, high = _between(parts, p, normal)
        plane = np.einsum("nk,nk->n", facets.corners[f, 0], normal)
        meets = (np.minimum(high - plane, plane - low) > ROUNDING_M) | ~normal.any(axis=1)
        p, f = p[meets], f[meets]
        way = facets.corners[f].mean(axis=1) - middles[p]
        way /= np.maximum(np.sqrt((way**2).sum(axis=1, keepdims=True)), 1e-30)
        meets = _between(parts, p, way)[1] - _least(facets.corners[f], way) > ROUNDING_M
        found.append((p[meets], f[meets]))
    part, facet = map(np.concatenate, zip(*found, strict=True))
    return part, facet


def _least(corners: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Return the least place (n,) of triangles (n, 3, 3) along ways (n, 3)."""
    a, b, c = (np.einsum("nk,nk->n", corners[:, k], ways) for k in range(3))
    found: np.ndarray = np.minimum(np.minimum(a, b), c)
    return found


def _between(parts: Parts, part: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest place (n,) of parts along ways (n, 3)."""
    if not len(part):
        return np.zeros(0), np.zeros(0)
    rows, starts = rows_of(parts, part)
    along = np.einsum("nk,nk->n", parts.corners[rows], np.repeat(ways, np.diff(np.append(starts, len(rows))), axis=0))
    return np.minimum.reduceat(along, starts), np.maximum.reduceat(along, starts)
