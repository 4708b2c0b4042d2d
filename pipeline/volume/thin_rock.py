"""Rock that is thinner than a body sinks in is made thicker, at the cost of the free space behind it."""

from __future__ import annotations

import manifold3d
import numpy as np

from pipeline.volume.keyed import KeyedSolid, keyed, near_facets, volume_of
from pipeline.volume.shell import facets_without_part
from pipeline.volume.slivers import without_slivers
from pipeline.volume.union import Label, Volume

# Half of the rock that is put before a facet in each round, m: parts of 2 cm fit into it; and the facets that are worth
# it, m2: the rock before one makes others at its rim, so that smaller ones would never end.
_ROUNDS = ((0.027, 1e-4), (0.03, 1e-5), (0.033, 1e-5), (0.036, 1e-5), (0.04, 1e-5), (0.045, 1e-5))
_ALWAYS = 2  # rounds; others if there is more left than this, m2
_LEFT_M2 = 0.02
_ROOF_NZ = 0.7  # of a facet's normal, which points out of the free space


def without_thin_rock(volume: Volume) -> Volume:
    """Return the volume with at least 2 cm of rock behind its facets.

    In front of each facet behind which no part of 2 cm is in the rock, 5 cm or more become rock: two passages with less
    between them stay two, and folds of rock without a thickness get one. Nothing is put on floors, so that they keep
    their heights: what a part below them reaches gets the rock. Each round looks about the rock of the one before.
    """
    some: np.ndarray | None = None
    for number, (half_m, least_m2) in enumerate(_ROUNDS):
        facets, thin_m2 = _to_thicken(volume, some, least_m2)
        if not len(facets) or (number >= _ALWAYS and thin_m2 < _LEFT_M2):
            break
        changed = volume.vertices[volume.faces[facets]]
        volume = without_slivers(_thickened(volume, facets, half_m))
        some = near_facets(volume.vertices[volume.faces], changed, 4 * half_m)
    return volume


def _to_thicken(volume: Volume, some: np.ndarray | None, least_m2: float) -> tuple[np.ndarray, float]:
    """Return the facets in front of which rock is put, and the area of those with thin rock, m2."""
    area = np.linalg.norm(volume.normals, axis=1) / 2
    is_floor = volume.label == Label.FLOOR
    thin = {k: reached for k, reached in facets_without_part(volume, some).items() if area[k] > least_m2}
    facets = {below for k, reached in thin.items() for below in (reached if is_floor[k] else [k])}
    found = np.array(sorted(facets), int)
    return found[~is_floor[found]], float(area[list(thin)].sum())


def _thickened(volume: Volume, facets: np.ndarray, half_m: float) -> Volume:
    """Return the volume without what is before some of its facets: prisms with bevelled edges, wider than the facet.

    They are twice as deep as `half_m`, and so much wider on each side.
    """
    one = keyed(volume, volume.vertices, volume.label)
    corners, normal = volume.vertices[volume.faces[facets]], -volume.normals[facets]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    along = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal), axis=1)])
    along /= np.linalg.norm(along, axis=1, keepdims=True).clip(1e-30)
    across = np.cross(normal, along)
    ring = np.stack([along + across, across - along, -along - across, along - across], axis=1)
    ball = half_m * np.concatenate([0 * ring[:, :1], ring + normal[:, None], ring + 2 * normal[:, None]], axis=1)
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
