"""Shapes of a part behind a convex polygon of facets, from the best to the thinnest."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np

from pipeline.geometry.facets.separation import ConvexBodies

DEPTHS_M = (0.3, 0.15, 0.08, 0.04, 0.02)
MOVED_AND_CUT = tuple((kind, depth) for depth in DEPTHS_M for kind in ("moved", "cut"))
SHAPES = (
    *MOVED_AND_CUT,
    *(("pyramid", depth) for depth in DEPTHS_M[:-1]),
    *(("plate", depth) for depth in DEPTHS_M[2:]),
)
_FORWARD = 0.1  # of a corner's way along the normal; one that goes less into the rock goes along the normal


@dataclass(frozen=True)
class Polygons:
    """Convex polygons of facets with equally many corners.

    Attributes
    ----------
    numbers : (n,) int64
        Of the surfaces that they are.
    corners : (n, k, 3) float64, m
    ways : (n, k, 3) float64
        From each corner into the rock, one metre behind all its facets.
    normals : (n, 3) float64
        Unit vector into the rock.
    beside : (n, k, 3) float64
        Unit normals of the facets across the edge from each corner to the next.
    areas_m2 : (n,) float64
    """

    numbers: np.ndarray
    corners: np.ndarray
    ways: np.ndarray
    normals: np.ndarray
    beside: np.ndarray
    areas_m2: np.ndarray

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.numbers)

    def some(self, chosen: np.ndarray | list[int]) -> Polygons:
        """Return those that are chosen."""
        return Polygons(*(column[chosen] for column in vars(self).values()))


def shaped(polygons: Polygons, kind: str, depth_m: float) -> ConvexBodies:
    """Return the polygons' parts of one shape.

    `moved`: the polygon, moved by the depth along the ways of its corners. `cut`: the same, cut along the bisectors of
    the rock's edges. `pyramid`: over the polygon. `plate`: moved along its normal.
    """
    if kind == "cut":
        return bodies_of(_cut(polygons, depth_m), polygons.corners, -polygons.normals, polygons.numbers)
    corners, normals = polygons.corners, polygons.normals[:, None]
    if kind == "pyramid":
        back = corners.mean(axis=1, keepdims=True) + depth_m * normals
        sides = np.cross(np.roll(corners, -1, axis=1) - corners, back - corners)
        edges = np.concatenate([np.roll(corners, -1, axis=1) - corners, back - corners], axis=1)
        points = np.concatenate([corners, back], axis=1)
        return ConvexBodies(
            points, np.concatenate([-normals, _outward(sides, corners, points)], 1), edges, polygons.numbers
        )
    forward = np.broadcast_to(normals, corners.shape)
    if kind == "moved":
        forward = forward_ways(polygons.ways, polygons.normals)
    return _prism(corners, corners + depth_m * forward, polygons)


def forward_ways(ways: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the ways (n, k, 3) of polygons' corners into the rock; those that hardly go there along the normal."""
    ahead = np.einsum("nck,nk->nc", ways, normals) > _FORWARD
    found: np.ndarray = np.where(ahead[:, :, None], ways, normals[:, None])
    return found


def _prism(front: np.ndarray, back: np.ndarray, polygons: Polygons) -> ConvexBodies:
    """Return the hulls of polygons and their moved copies; sides that are no planes are tried by either diagonal."""
    to, up, over = np.roll(front, -1, axis=1) - front, back - front, np.roll(back, -1, axis=1) - back
    following = np.roll(up, -1, axis=1)
    points = np.concatenate([front, back], axis=1)
    normals = polygons.normals[:, None]
    sides = [_outward(np.cross(a, b), front, points) for a, b in ((to, up), (to, following))]
    sides += [_outward(np.cross(over, b), back, points) for b in (up, following)]
    behind = _outward(np.cross(over, np.roll(over, -1, axis=1)), back, points)
    directions = np.concatenate([-normals, normals, *sides, behind], axis=1)
    return ConvexBodies(points, directions, np.concatenate([to, up, over], axis=1), polygons.numbers)


def _outward(normals: np.ndarray, at: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return unit normals that go away from the middle of the points."""
    away = np.einsum("nck,nck->nc", normals, at - points.mean(axis=1, keepdims=True))[:, :, None]
    size = np.linalg.norm(normals, axis=2, keepdims=True)
    found: np.ndarray = np.where(away < 0, -normals, normals) / np.maximum(size, 1e-30)
    # Of no area: the direction of the first is tried twice.
    return np.where(size > 1e-12, found, found[:, :1])


def _cut(polygons: Polygons, depth_m: float) -> list[manifold3d.Manifold]:
    solids = [manifold3d.Manifold.hull_points(points) for points in shaped(polygons, "moved", depth_m).corners]
    ways, offsets = halving_planes(polygons)
    for n, k in zip(*np.nonzero(np.isfinite(offsets)), strict=True):
        solids[n] = solids[n].trim_by_plane(ways[n, k], offsets[n, k])
    return solids


def bodies_of(
    solids: list[manifold3d.Manifold], fronts: np.ndarray, outward: np.ndarray, owner: np.ndarray
) -> ConvexBodies:
    """Return convex solids as bodies; those of no volume are their front, which is in nothing.

    Parameters
    ----------
    solids : list of manifold3d.Manifold
    fronts : (n, k, 3) float64, m
        Corners of the face of each that lies on the free space's surface.
    outward : (n, 3) float64
        Unit normal of that face, out of the solid.
    owner : (n,) int64
        As of `ConvexBodies`.
    """
    points, faces = [], []
    for front, solid in zip(fronts, solids, strict=True):
        if solid.is_empty() or solid.volume() <= 0:
            points.append(front)
            faces.append(np.array([[0, 1, 2]]))
            continue
        mesh = solid.to_mesh64()
        points.append(np.asarray(mesh.vert_properties)[:, :3])
        faces.append(np.asarray(mesh.tri_verts, np.int64))
    counts, sizes = np.array([*map(len, points)]), np.array([*map(len, faces)])
    of_solid = np.repeat(np.cumsum(counts) - counts, sizes)
    a, b, c = np.moveaxis(np.concatenate(points)[np.concatenate(faces) + of_solid[:, None]], 1, 0)
    normal = np.cross(b - a, c - a)
    size = np.sqrt((normal**2).sum(axis=1, keepdims=True))
    # Of no area: the front's direction is tried twice.
    normal = np.where(size > 1e-12, normal / np.maximum(size, 1e-30), np.repeat(outward, sizes, axis=0))
    return ConvexBodies(
        padded(np.concatenate(points), counts),
        np.concatenate([outward[:, None], padded(normal, sizes)], axis=1),
        np.concatenate([padded(b - a, sizes), padded(c - b, sizes)], axis=1),
        owner,
    )


def padded(rows: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return rows (r, 3), so many of each body, as one array; shorter bodies repeat their last one."""
    first = np.cumsum(counts) - counts
    found: np.ndarray = rows[first[:, None] + np.minimum(np.arange(counts.max()), counts[:, None] - 1)]
    return found


def halving_planes(polygons: Polygons) -> tuple[np.ndarray, np.ndarray]:
    """Return the planes that halve the rock at each polygon's edges: normals (n, k, 3) to the part, offsets (n, k).

    Where the rock is not a wedge at an edge, the offset is -inf.
    """
    corners, normals = polygons.corners, polygons.normals[:, None]
    edge = np.roll(corners, -1, axis=1) - corners
    edge /= np.maximum(np.linalg.norm(edge, axis=2, keepdims=True), 1e-30)
    inward = np.cross(normals, edge)  # in the polygon, away from the edge
    ways = np.cross(edge, -(normals + polygons.beside))
    size = np.linalg.norm(ways, axis=2, keepdims=True)
    ways = np.where(size < 1e-6, inward, ways / np.maximum(size, 1e-6))
    ways *= np.where((ways * inward).sum(axis=2, keepdims=True) > 0, 1, -1)
    is_wedge = (inward * polygons.beside).sum(axis=2) <= -1e-6
    return ways, np.where(is_wedge, (ways * corners).sum(axis=2), -np.inf)
