"""Closed solids that meet in a face, made to overlap: rounding of their corners leaves gaps between them."""

from __future__ import annotations

import manifold3d
import numpy as np
import shapely

_LEAST_M2 = 0.01  # of a face in which solids meet
_ALONG = 0.999  # cosine between normals of facets that lie on each other


def overlapping(solids: list[manifold3d.Manifold], is_rock: np.ndarray, reach_m: float) -> list[manifold3d.Manifold]:
    """Return solids whose corners on a facet of another are moved beyond it, by twice a reach, m.

    A facet of two solids of free space, or of two of rock, looks the other way than that it lies on. One of rock that
    lies on the border of the free space looks the same way as that, and is moved into the rock behind. Facets lie on
    each other if no more than the reach is between them. Where no corner is on a facet, those of the smaller facet are
    moved.

    Parameters
    ----------
    solids : list
    is_rock : (n,) bool
    reach_m : float
    """
    if len(solids) < 2:
        return solids
    meshes = [_mesh(solid) for solid in solids]
    piece = np.repeat(np.arange(len(meshes)), [len(faces) for _, faces in meshes])
    first = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    vertices = np.concatenate([vertices for vertices, _ in meshes])
    faces = np.concatenate([faces + start for (_, faces), start in zip(meshes, first[:-1], strict=True)])
    pairs = _candidates(vertices[faces], piece, is_rock, reach_m)
    moves = _moves(vertices, faces, pairs, is_rock[piece], reach_m)
    for corner, ways in moves.items():
        vertices[corner] += 2 * reach_m * np.sum(ways, axis=0)
    changed = set(np.searchsorted(first, list(moves), side="right") - 1)
    return [
        _moved(solid, vertices[first[k] : first[k + 1]], meshes[k][1]) if k in changed else solid
        for k, solid in enumerate(solids)
    ]


def _mesh(solid: manifold3d.Manifold) -> tuple[np.ndarray, np.ndarray]:
    mesh = solid.to_mesh64()
    return np.array(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64)


def _moved(solid: manifold3d.Manifold, vertices: np.ndarray, faces: np.ndarray) -> manifold3d.Manifold:
    moved = manifold3d.Manifold(manifold3d.Mesh64(np.ascontiguousarray(vertices), faces.astype(np.uint64)))
    return moved if moved.status() == manifold3d.Error.NoError else solid


def _normals(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit normals (k, 3) and areas (k,) of triangles."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.linalg.norm(normal, axis=1)
    return normal / np.maximum(twice, 1e-30)[:, None], twice / 2


def _candidates(corners: np.ndarray, piece: np.ndarray, is_rock: np.ndarray, reach_m: float) -> np.ndarray:
    """Return the pairs (k, 2) of facets of two solids whose boxes meet and whose normals are along each other."""
    normal, area = _normals(corners)
    large = np.flatnonzero(area > _LEAST_M2)
    low, high = corners[large].min(axis=1) - reach_m, corners[large].max(axis=1) + reach_m
    boxes = shapely.box(*low[:, :2].T, *high[:, :2].T)
    a, b = shapely.STRtree(boxes).query(boxes)
    meets = (a < b) & (piece[large[a]] != piece[large[b]]) & (low[a, 2] < high[b, 2]) & (low[b, 2] < high[a, 2])
    one, other = large[a[meets]], large[b[meets]]
    along = np.einsum("ij,ij->i", normal[one], normal[other])
    differ = is_rock[piece[one]] != is_rock[piece[other]]
    return np.column_stack([one, other])[np.where(differ, along, -along) > _ALONG]


def _moves(
    vertices: np.ndarray, faces: np.ndarray, pairs: np.ndarray, of_rock: np.ndarray, reach_m: float
) -> dict[int, list[np.ndarray]]:
    """Return the directions in which corners are moved: the normals of their facets that lie on another."""
    corners = vertices[faces]
    normal, area = _normals(corners)
    moves: dict[int, list[np.ndarray]] = {}
    for one, other in pairs.tolist():
        origin, up = corners[one, 0], normal[one]
        aside = np.linalg.svd(up[None])[2][1:]
        flat = [(corners[k] - origin) @ aside.T for k in (one, other)]
        meet = shapely.intersection(*shapely.polygons(np.array(flat)))
        if meet.area < _LEAST_M2:
            continue
        middle = origin + np.array(meet.centroid.coords[0]) @ aside
        if abs((middle - corners[other, 0]) @ normal[other]) > reach_m:
            continue
        movable = [k for k in (one, other) if of_rock[k] or of_rock[one] == of_rock[other]]
        near = [(k, int(c)) for k in movable for c in faces[k][_on(corners[k], corners[one + other - k], reach_m)]]
        smaller = min(movable, key=lambda k: area[k])
        for k, corner in near or [(smaller, int(c)) for c in faces[smaller]]:
            ways = moves.setdefault(corner, [])
            if all(way @ normal[k] < _ALONG for way in ways):
                ways.append(normal[k])
    return moves


def _on(places: np.ndarray, triangle: np.ndarray, reach_m: float) -> np.ndarray:
    """Return which places (k, 3) m are on a triangle (3, 3)."""
    up = _normals(triangle[None])[0][0]
    aside = np.linalg.svd(up[None])[2][1:]
    flat, height = (places - triangle[0]) @ aside.T, (places - triangle[0]) @ up
    beside = shapely.distance(shapely.points(flat), shapely.Polygon((triangle - triangle[0]) @ aside.T))
    return np.asarray((np.abs(height) <= reach_m) & (beside <= reach_m))
