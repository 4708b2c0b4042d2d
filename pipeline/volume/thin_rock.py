"""Rock that is thinner than a body sinks in is made thicker, at the cost of the free space behind it."""

from __future__ import annotations

import manifold3d
import numpy as np

from pipeline.volume.keyed import KeyedSolid, keyed, volume_of
from pipeline.volume.shell import facets_without_part
from pipeline.volume.slivers import without_slivers
from pipeline.volume.union import Label, Volume

_HALF_M = 0.02  # of the rock that is put behind a facet: a part of 2 cm fits into it
_ROUNDS = 4
_ROOF_NZ = 0.7  # of a facet's normal


def without_thin_rock(volume: Volume) -> Volume:
    """Return the volume with at least 2 cm of rock behind its facets.

    Behind each facet where no part of 2 cm is in the rock, 4 cm become rock: two passages with less between them stay
    two, and folds of rock without a thickness get one. Where the other side is a floor, the rock is put under the floor
    instead, so that floors keep their heights.
    """
    for _ in range(_ROUNDS):
        thin = facets_without_part(volume)
        facets = np.unique([k for facet, others in thin.items() for k in _sides(volume, facet, others)])
        if not len(facets):
            break
        volume = without_slivers(_thickened(volume, facets.astype(int)))
    return volume


def _sides(volume: Volume, facet: int, others: list[int]) -> list[int]:
    """Return the facets behind which the rock is to be: the facet, or the floors on the other side."""
    floors = [k for k in others if volume.label[k] == Label.FLOOR]
    return floors if floors and volume.label[facet] != Label.FLOOR else [facet]


def _thickened(volume: Volume, facets: np.ndarray) -> Volume:
    """Return the volume without what is up to 4 cm behind some of its facets."""
    one = keyed(volume, volume.vertices, volume.label)
    corners, normal = volume.vertices[volume.faces[facets]], -volume.normals[facets]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    along = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal), axis=1)])
    along /= np.linalg.norm(along, axis=1, keepdims=True).clip(1e-30)
    axes = np.stack([normal, along, np.cross(normal, along)], axis=1)
    ball = _HALF_M * np.concatenate([axes, -axes], axis=1) - _HALF_M * normal[:, None]
    keys, bodies = dict(one.keys), []
    for k, points, spread in zip(facets.tolist(), corners, ball, strict=True):
        body = manifold3d.Manifold.hull_points((points[:, None] + spread).reshape(-1, 3)).as_original()
        keys[body.original_id()] = len(Label) * int(volume.source[k]) + Label.WALL
        bodies.append(body)
    solid = manifold3d.Manifold.batch_boolean([one.solid, *bodies], manifold3d.OpType.Subtract)
    found = volume_of(KeyedSolid(solid, keys), volume)
    up = found.normals[:, 2] > _ROOF_NZ * np.linalg.norm(found.normals, axis=1)
    found.label[up & (found.label == Label.WALL)] = Label.ROOF
    return found
