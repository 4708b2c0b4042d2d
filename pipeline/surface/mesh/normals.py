"""Normals for shading a mesh: averaged over the faces round a vertex, so that chunks of it meet without a seam."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

_AT_ONCE = 65536  # faces in memory at a time
_TILTS = 16  # rounds at most; of 48,000 vertices of the default world they tilt 38,000, and more rounds hardly any more
_FRONT = 0.02  # cosine of the widest angle between a normal and its faces' that counts as in front
SMOOTH_DEG = 180.0  # no two faces meet at a sharper angle
_NONE, _UP = 0.5, (0.0, 0.0, 1.0)  # length of a normal that is none: all faces at its vertex have no area


@dataclass(frozen=True)
class ShadedMesh:
    """A mesh whose vertices carry a normal; a vertex on a crease stands once for each side of it.

    `source` (k,) is the number of each vertex in the mesh that it was made of, `normals` (k, 3) are unit vectors and
    `faces` (m, 3) are the same faces in the same order and winding. `tilted` (k,) are normals that are no mean.
    """

    source: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    tilted: np.ndarray


def shade_mesh(vertices: np.ndarray, faces: np.ndarray, crease_deg: float = SMOOTH_DEG) -> ShadedMesh:
    """Return the mesh with a normal at every vertex, less than a right angle from those of its faces.

    Face normals are weighted by the face's angle at the vertex, which makes the mean independent of how a surface is
    cut into triangles; weighted by area, three times as many normals of the default rock lie behind one of their faces.
    A normal that lies behind one is tilted until it does not. Where no direction is in front of all faces, the vertex
    is split and each face keeps its own normal there.

    Parameters
    ----------
    vertices : (n, 3), m
    faces : (m, 3) int
        Of the whole surface, so that vertices on the border of two chunks see the faces of both.
    crease_deg : float
        Faces that meet at a sharper angle share no normal; 180 shades everything smoothly.

    References
    ----------
    Thuermer & Wuethrich 1998, J. Graphics Tools 3(1), doi:10.1080/10867651.1998.10487487
    """
    parts = [normals_and_angles(vertices[faces[at : at + _AT_ONCE]]) for at in range(0, len(faces), _AT_ONCE)]
    normal, angle = (np.concatenate(part) for part in zip(*parts, strict=True))
    source, corner = np.arange(len(vertices)), faces.astype(np.int64)
    if crease_deg < SMOOTH_DEG:
        source, corner = _split(corner, _fans(corner, normal, crease_deg))
    flat, weighted = corner.ravel(), ((angle * normal[:, k, None]).ravel() for k in range(3))
    mean = _unit(np.column_stack([np.bincount(flat, of_axis, len(source)) for of_axis in weighted]))
    former_mean = mean.copy()
    alone = _tilt(mean, corner, normal)[corner]  # the corners at vertices that no one normal serves
    tilted = (mean != former_mean).any(axis=1)
    if alone.any():
        group = np.where(alone, len(source) + np.arange(corner.size).reshape(-1, 3), corner)
        former, corner = _split(corner, group)
        source, mean, tilted = source[former], mean[former], tilted[former]
        mean[corner[alone]] = normal[np.nonzero(alone)[0]]
    mean[np.linalg.norm(mean, axis=1) < _NONE] = _UP
    return ShadedMesh(source, mean, corner.astype(np.int32), tilted)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-30)


def normals_and_angles(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit normals (m, 3) of faces (m, 3, 3) m, and their angles (m, 3) rad at their corners."""
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    angles = np.arctan2(np.linalg.norm(np.cross(ahead, behind), axis=2), (ahead * behind).sum(axis=2))
    return _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])), angles


def _tilt(mean: np.ndarray, corner: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Tilt, in place, the normals that lie behind one of their faces; return (n,) where none is in front of all.

    Each round adds the normals of the faces that are seen from behind: the perceptron's rule, which ends where a
    direction in front of all faces exists.
    """
    solid = np.linalg.norm(normal, axis=1) > 0  # a face without area has no front
    front = (np.einsum("mki,mi->mk", mean[corner], normal) >= _FRONT) | ~solid[:, None]
    bad = np.zeros(len(mean), bool)
    bad[corner[~front]] = True
    face, side = np.nonzero(bad[corner])
    vertex, at = np.unique(corner[face, side], return_inverse=True)
    tilted, of_face = mean[vertex], normal[face]
    behind = ~front[face, side]
    for _ in range(_TILTS):
        push = np.column_stack([np.bincount(at, behind * of_face[:, k], len(vertex)) for k in range(3)])
        tilted = _unit(tilted + push)
        behind = (np.einsum("ni,ni->n", tilted[at], of_face) < _FRONT) & solid[face]
    mean[vertex] = tilted
    bad[vertex] = np.bincount(at, behind, len(vertex)) > 0
    return bad


def _fans(corner: np.ndarray, normal: np.ndarray, crease_deg: float) -> np.ndarray:
    """Return the number (m, 3) of the fan of faces that each corner belongs to: no crease runs within a fan."""
    face = np.tile(np.arange(len(corner)), 3)
    start, end = (np.concatenate([np.roll(corner, -k, axis=1)[:, j] for j in range(3)]) for k in (0, 1))
    key = np.minimum(start, end) * (corner.max() + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    pair = np.flatnonzero(np.diff(key[order]) == 0)
    one, two = order[pair], order[pair + 1]
    smooth = np.einsum("ni,ni->n", normal[face[one]], normal[face[two]]) >= np.cos(np.radians(crease_deg))
    one, two = one[smooth], two[smooth]
    # Side j of a face runs from its corner j to corner j + 1; the neighbour's side runs the other way.
    node = np.arange(3 * len(corner)).reshape(3, -1)
    next_node = np.roll(node, -1, axis=0).ravel()
    along = start[one] == start[two]
    left = np.concatenate([one, next_node[one]])
    right = np.concatenate([np.where(along, two, next_node[two]), np.where(along, next_node[two], two)])
    links = coo_array((np.ones(len(left)), (left, right)), shape=(node.size, node.size))
    return connected_components(links, directed=False)[1].reshape(3, -1).T


def _split(corner: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the former vertex (k,) of each group of corners, and the corners' new numbers (m, 3), one for a group."""
    _, first, number = np.unique(group, return_index=True, return_inverse=True)
    return corner.ravel()[first], number.reshape(group.shape)
