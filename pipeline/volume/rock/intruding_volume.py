"""The volume that convex parts share with the free space, summed over the facets about each part."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import manifold3d
import numpy as np

from pipeline.geometry.facets.separation import Facets

_SURE = 1e-2  # of a part behind facets, at least: less may be a fold of the surface
_TOGETHER = 200  # parts: their triangles and the facets near them take some 10 MB


def shared_m3(facets: Facets, parts: Sequence[np.ndarray], are_free: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the volume (n,) m3 that convex parts share with the free space.

    Seen from a part's middle, free space ends or begins at each facet. So what of the part is behind a facet counts,
    less or more, and the sum is all of it if the middle is in rock; else it is what is missing from the whole part.
    Its sign says which. No boolean with the whole free space is needed.

    Parameters
    ----------
    facets : Facets
        Of the free space's mesh: all that are near the parts.
    parts : sequence of (k, 3) float64, m
        The parts' corners.
    are_free : function
        Of places (k, 3) m, which are in the free space: the middles of parts into which hardly a facet reaches.
    """
    found = [np.zeros(0)]
    for start in range(0, len(parts), _TOGETHER):
        hulls = [_hull(part) for part in parts[start : start + _TOGETHER]]
        size = np.array([_tetrahedra_m3(sides).sum() for _, sides in hulls])
        behind = _behind_m3(facets, hulls)
        is_free = behind < 0
        unsure = np.flatnonzero(np.abs(behind) <= _SURE * size)
        if len(unsure):
            is_free[unsure] = are_free(np.array([hulls[k][0] for k in unsure]))
        found.append(np.maximum(np.where(is_free, size + behind, behind), 0.0))
    return np.concatenate(found)


def _hull(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle (3,) m of a part's corners, and its triangles (t, 3, 3) from there; none without a volume."""
    middle, solid = corners.mean(axis=0), manifold3d.Manifold.hull_points(corners)
    if solid.is_empty() or solid.volume() <= 0:
        return middle, np.zeros((0, 3, 3))
    mesh = solid.to_mesh64()
    places = np.asarray(mesh.vert_properties)[:, :3] - middle
    return middle, places[np.asarray(mesh.tri_verts, np.int64)]


def _behind_m3(facets: Facets, hulls: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Return the volume (n,) m3 of parts behind facets at which free space begins, less that behind the others."""
    middles = np.array([middle for middle, _ in hulls])
    counts = np.array([len(sides) for _, sides in hulls])
    sides = np.concatenate([sides for _, sides in hulls])
    first = np.cumsum(counts) - counts
    filled = np.flatnonzero(counts)
    found = np.zeros(len(hulls))
    if not len(filled):
        return found
    points = (sides + np.repeat(middles, counts, axis=0)[:, None]).reshape(-1, 3)
    low, high = (pick.reduceat(points, 3 * first[filled]) for pick in (np.minimum, np.maximum))
    part, facet = facets.near(low, high)
    part = filled[part]
    corners = facets.corners[facet] - middles[part][:, None]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    offset = np.einsum("nk,nk->n", normal, a)
    sign = np.sign(offset)[:, None]
    planes = np.stack([sign * normal, *(sign * np.cross(p, q) for p, q in ((a, b), (b, c), (c, a)))], axis=1)
    offsets = np.abs(offset)
    pair = np.repeat(np.arange(len(part)), counts[part])
    row = np.arange(len(pair)) + np.repeat(first[part] - (np.cumsum(counts[part]) - counts[part]), counts[part])
    over = np.einsum("npk,nck->npc", planes[pair], sides[row])
    over[:, 0] -= offsets[pair, None]
    reaches = (over > 0).any(axis=2).all(axis=1) & (offsets[pair] > 0)
    pair, row = pair[reaches], row[reaches]
    polygons = sides[row]
    for number in range(4):
        polygons = _clipped(polygons, planes[pair, number], offsets[pair] if number == 0 else np.zeros(len(pair)))
    share = offsets[pair, None] / np.maximum(np.einsum("nck,nk->nc", polygons, planes[pair, 0]), offsets[pair, None])
    volume = np.zeros(len(pair))
    for k in range(1, polygons.shape[1] - 1):
        beyond = 1 - share[:, 0] * share[:, k] * share[:, k + 1]
        volume += beyond * _tetrahedra_m3(polygons[:, [0, k, k + 1]])
    np.add.at(found, part[pair], -sign[pair, 0] * volume)
    return found


def _clipped(polygons: np.ndarray, ways: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Return what of convex polygons (n, k, 3) is beyond planes, as (n, k + 1, 3); shorter lists repeat a corner.

    Of a polygon with nothing beyond its plane one corner is left.
    """
    over = np.einsum("nck,nk->nc", polygons, ways) - offsets[:, None]
    following, after = np.roll(polygons, -1, axis=1), np.roll(over, -1, axis=1)
    inside = over >= 0
    crosses = inside != (after >= 0)
    share = np.where(crosses, over / np.where(crosses, over - after, 1.0), 0.0)
    between = polygons + share[:, :, None] * (following - polygons)
    n, k = over.shape
    both = np.stack([polygons, between], axis=2).reshape(n, 2 * k, 3)
    kept = np.stack([inside, crosses], axis=2).reshape(n, 2 * k)
    order = np.argsort(~kept, axis=1, kind="stable")[:, : k + 1]
    last = np.maximum(kept.sum(axis=1) - 1, 0)
    order = np.take_along_axis(order, np.minimum(np.arange(k + 1), last[:, None]), axis=1)
    found: np.ndarray = np.take_along_axis(both, order[:, :, None], axis=1)
    return found


def _tetrahedra_m3(sides: np.ndarray) -> np.ndarray:
    """Return the volumes (n,) m3 between the origin and triangles (n, 3, 3)."""
    found: np.ndarray = np.einsum("nk,nk->n", sides[:, 0], np.cross(sides[:, 1], sides[:, 2])) / 6
    return found
