"""The surveyed floors along legs, and what is under them in a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.geometry.ray_scene import ray_scene
from pipeline.volume.height_field.plan_weights import plan_weights
from pipeline.volume.network import WITHIN_M, NearLegs, SurveyNetwork
from pipeline.volume.union import Volume

_SAMPLE_M = 0.05  # along a leg: the union's triangles may be as small
_OWN_FLOOR_M = 0.01  # of a steep leg: a floor that is deeper is that of another
_OVER_M = 0.1  # over a surveyed floor
_PLUMB = 0.1  # of a facet's normal: so steep a facet has hardly an area seen from above
_DEEPEST_M = 0.6  # under a surveyed floor: what is deeper is another floor


@dataclass(frozen=True)
class AlongLegs:
    """Places on surveyed floors: the facet (n,) under each, the weights (n, 3) of its corners, height, and leg (n,)."""

    facet: np.ndarray
    weights: np.ndarray
    height_m: np.ndarray
    shot: np.ndarray


def leg_floor_samples(
    network: SurveyNetwork, shots: np.ndarray, step_m: float, aside_m: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, 3) m on the surveyed floors along some shots, from end to end, and their shots (n,).

    With `aside_m` they are so far to the left, or as far as there is room. They are 5 mm inside the section: a line
    that runs on a wall, or ends at one, has a floor on one side alone.
    """
    counts = np.maximum(2, np.ceil(network.lengths_m[shots] / step_m).astype(int) + 1)
    share = np.concatenate([np.linspace(0, 1, count) for count in counts]) if len(shots) else np.zeros(0)
    owner = np.repeat(shots, counts)
    end = np.minimum(WITHIN_M / network.lengths_m[owner], 0.5)
    share = np.clip(share, end, 1 - end)[:, None]
    ways = network.beside_m(aside_m)[owner]
    return ways[:, 0] + share * (ways[:, 1] - ways[:, 0]), owner


def way_samples(network: SurveyNetwork, step_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, 3) m over the surveyed floors of all shots, and their shots (n,): what of a leg is free.

    They are 0.1 m over the floor, or half of the least height.
    """
    places, owner = leg_floor_samples(network, np.arange(len(network.shots)), step_m)
    above = np.minimum(_OVER_M, network.lrud_m[:, :, 2:].sum(axis=2).min(axis=1) / 2)[owner]
    return places + above[:, None] * np.array([0, 0, 1.0]), owner


def drop(vertices: np.ndarray, faces: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the facet (n,) under each place, -1 where none is, and the height (n,) m of the mesh there.

    The facet is found in 32 bits, its height with all digits where it is not nearly plumb.
    """
    middle = vertices.mean(axis=0)
    scene = ray_scene(vertices - middle, faces, 1)
    rays = np.column_stack([places - middle, np.tile([0, 0, -1.0], (len(places), 1))]).astype(np.float32)
    found = scene.cast_rays(rays, nthreads=1)
    hit = found["primitive_ids"].numpy().astype(np.int64)
    way = found["t_hit"].numpy().astype(float)
    hit = np.where(np.isfinite(way), hit, -1)
    weights = plan_weights(vertices, faces[hit], places)
    a, b, c = np.moveaxis(vertices[faces[hit]], 1, 0)
    normal = np.cross(b - a, c - a)
    is_plumb = np.abs(normal[:, 2]) < _PLUMB * np.linalg.norm(normal, axis=1)
    height = np.where(is_plumb, places[:, 2] - way, np.sum(weights * vertices[faces[hit], 2], axis=1))
    height = np.where(hit >= 0, height, np.nan)
    return hit, height


def along_legs(volume: Volume, network: SurveyNetwork, near: NearLegs, is_floor: np.ndarray) -> AlongLegs:
    """Return the facets under places of the legs, and the floors' heights there.

    A place counts if the first facet under it is floor, at most `_DEEPEST_M` below the surveyed floor. If the floor is
    that of a drivable leg elsewhere in the survey, or the leg is too steep to drive, it counts only where that is its
    own floor: a floor does not rise to a leg that climbs out of it or passes over it.
    """
    shots = np.unique([piece.shot for piece in volume.pieces if not piece.is_plumb])
    drivable = np.zeros(len(network.shots), bool)
    drivable[[piece.shot for piece in volume.pieces if piece.is_drivable]] = True
    places, owner = leg_floor_samples(network, shots, _SAMPLE_M)
    hit, height = drop(volume.vertices, volume.faces, places + np.array([0, 0, 0.1]))
    under = np.array([piece.shot for piece in volume.pieces])[volume.source[hit]]
    meets = drivable[owner] & (near.has(owner, under) | ~drivable[under])
    good = (hit >= 0) & is_floor[hit] & (places[:, 2] - height < np.where(meets, _DEEPEST_M, _OWN_FLOOR_M))
    weights = plan_weights(volume.vertices, volume.faces[hit[good]], places[good])
    return AlongLegs(hit[good], weights, places[good, 2], owner[good])
