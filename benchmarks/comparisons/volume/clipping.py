"""Parts clipped so that nothing is in the free space: by planes between the facet in front and those that reach in."""

from __future__ import annotations

import manifold3d
import numpy as np

from benchmarks.comparisons.volume.separation import ROUNDING_M, ConvexBodies, Facets
from benchmarks.comparisons.volume.shapes import Polygons, bodies_of, shaped

_ROUNDS = 40  # planes that clip one part, at most
_BEHIND_M = 0.1  # a place behind the facet's middle, to which the best plane leaves most room
_LEAST_SIZE = 1e-9  # of a cross product, by the product of its sides


def clipped(polygons: Polygons, depth_m: float, facets: Facets) -> ConvexBodies:
    """Return the polygons moved by a depth into the rock, each clipped until no facet reaches into it.

    A polygon and a facet that do not cross have a plane between them; the part behind the polygon is cut along it. A
    mesh that crosses itself has facets without such a plane, which stay in the part.
    """
    moved = shaped(polygons, "moved", depth_m)
    solids = [manifold3d.Manifold.hull_points(corners) for corners in moved.corners]
    bodies, open_ = bodies_of(solids, polygons), np.arange(len(polygons))
    for _ in range(_ROUNDS):
        contacts = facets.crossing(bodies.some(open_))
        order = np.argsort(-contacts.depth_m, kind="stable")
        _, first = np.unique(contacts.body[order], return_index=True)
        deepest = order[first]
        cut = []
        for body, facet in zip(open_[contacts.body[deepest]].tolist(), contacts.facet[deepest].tolist(), strict=True):
            plane = plane_between(polygons.corners[body], polygons.normals[body], facets.corners[facet])
            if plane is not None:
                solids[body] = solids[body].trim_by_plane(plane[:3], float(plane[3]))
                cut.append(body)
        if not cut:
            break
        open_ = np.array(cut)
        bodies = bodies_of(solids, polygons)
    return bodies


def plane_between(corners: np.ndarray, normal: np.ndarray, facet: np.ndarray) -> np.ndarray | None:
    """Return the plane (4,) that has a polygon before it and a facet behind it, its unit normal and offset; or None.

    Tried are the facet's plane and all through an edge of one and a corner of the other. The best is farthest from the
    place behind the polygon's middle.
    """
    sides, other = np.roll(corners, -1, axis=0) - corners, np.roll(facet, -1, axis=0) - facet
    normals = [np.cross(sides[:, None], facet[None] - corners[:, None]).reshape(-1, 3)]
    normals += [np.cross(other[:, None], corners[None] - facet[:, None]).reshape(-1, 3)]
    normals += [np.cross(other[0], other[1])[None]]
    at = [np.repeat(corners, len(facet), axis=0), np.repeat(facet, len(corners), axis=0), facet[:1]]
    n, p = np.concatenate(normals), np.concatenate(at)
    size = np.linalg.norm(n, axis=1)
    real = size > _LEAST_SIZE
    n, p = n[real] / size[real, None], p[real]
    n, p = np.concatenate([n, -n]), np.concatenate([p, p])
    offset = np.einsum("nk,nk->n", n, p)
    keeps = (corners @ n.T - offset).min(axis=0) > -ROUNDING_M
    keeps &= (facet @ n.T - offset).max(axis=0) < ROUNDING_M
    if not keeps.any():
        return None
    room = n @ (corners.mean(axis=0) + _BEHIND_M * normal) - offset
    best = int(np.argmax(np.where(keeps, room, -np.inf)))
    return np.append(n[best], offset[best]) if room[best] > 0 else None
