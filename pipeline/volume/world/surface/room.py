"""How much room there is about each point of a volume's walls: across the passage, and through the rock behind."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.geometry.ray_scene import ray_scene
from pipeline.surface.mesh.displacement import Room
from pipeline.surface.mesh.walls import smoothstep
from pipeline.volume.world.surface.fine import FineRock
from pipeline.volume.world.surface.narrow import NO_BALLS, Balls

_LIFT_M = 2e-3  # of the rays' starts off the surface, over the rounding of 32 bits
_CONES = ((0.0, 1), (35.0, 6), (65.0, 6))  # angle from the way across, deg, and rays
_ACROSS = (0, 1, 4)  # of these rays: from walls they lie level, and the median of the three measures the width
_STEEP = 0.9  # of a way's height: it has no level way across
_LEAST_M = 0.01  # of a radius, in means
_CELL_M = 0.4  # with one point that is asked for each way that walls in it face
_STEPS = 4  # along the mesh to points between; those that they do not reach are asked, too
_REACH_M = 0.36  # beyond a ball: relief from there could come into it
_FADE_M = 1.0  # farther away: there a wall has its own half width again, as rock that bulges at once crosses itself
_FAR_M = 100.0  # where a ray hits nothing


def room_about(rock: FineRock, volume: VolumeFacets, balls: Balls = NO_BALLS) -> Room:
    """Return half widths, and the largest balls that touch each point in the workings and in the rock.

    Rays in a cone about the way into the workings, and about the way into the rock, find both. The ball through a hit
    touches the surface. The narrowest passage is that of the smallest of the `balls` that fit in the passages. In a
    cave of uneven walls rays pass it by: about the narrowest balls the half width is their radius. Few points are
    asked; the others have the mean of those beside them that are known, step by step.
    """
    middle = volume.vertices.mean(axis=0)  # rays are cast in 32 bits
    scene = ray_scene(volume.vertices - middle, volume.faces, 1)
    radii, used = np.full((len(rock.vertices), 3), _FAR_M), np.flatnonzero(rock.direction.any(axis=1))
    asked = used[_last_in_cells(rock.vertices[used], rock.direction[used])]
    floor = volume.label == FacetLabel.FLOOR
    radii[asked] = _radii(scene, floor, rock.vertices[asked] - middle, rock.direction[asked])
    known = np.zeros(len(radii))
    known[asked] = 1.0
    for _ in range(_STEPS):
        weight = rock.links @ known
        beside = (known == 0) & (weight > 0)
        sums = rock.links @ (known[:, None] / np.maximum(radii, _LEAST_M))  # of inverses: smaller ones count more
        radii[beside] = weight[beside, None] / sums[beside]
        known[beside] = 1.0
    rest = used[known[used] == 0]
    radii[rest] = _radii(scene, floor, rock.vertices[rest] - middle, rock.direction[rest])
    half, free, behind = radii.T
    narrow = balls.narrowest
    if len(narrow.radii_m):
        far, number = cKDTree(narrow.middles_m).query(rock.vertices)
        radius = narrow.radii_m[number]
        own = smoothstep((far - radius - _REACH_M) / _FADE_M)
        half = np.minimum(half, radius + (half - radius) * own)
    narrowest_m = float(balls.radii_m.min()) if len(balls.radii_m) else 0.0
    return Room(half, free, behind, np.zeros(len(half)), narrowest_m)


def _last_in_cells(places: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Return the numbers of the last of the places (n, 3) m in each cell with ways (n, 3) of equal signs."""
    cells = np.column_stack([np.floor((places - places.min(axis=0)) / _CELL_M), ways > 0]).astype(np.int64)
    number = np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1))
    return len(places) - 1 - np.unique(number[::-1], return_index=True)[1]


def _radii(scene: Any, floor: np.ndarray, points: np.ndarray, inward: np.ndarray) -> np.ndarray:
    """Return half width, ball in the workings and ball in the rock, (n, 3) m.

    Opposite a `floor` (f,), which does not move, a roof has the whole height to itself.
    """
    free, along, facet = _distances(scene, points, inward)
    behind, _, _ = _distances(scene, points, -inward)
    shared = np.where(np.append(floor, False)[np.minimum(facet, len(floor))], 1.0, 2.0)
    half = np.median((free * along / shared)[:, _ACROSS], axis=1)
    return np.column_stack([half, (free / along).min(axis=1) / 2, (behind / along).min(axis=1) / 2])


def _distances(scene: Any, points: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return distances (n, rays) m along the cones' rays, cosines (rays,) of their angles, and facets (n, rays)."""
    first = np.cross(ways, np.where(np.abs(ways[:, 2:]) < _STEEP, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-12)
    second = np.cross(ways, first)
    rays, cosines = [], []
    for angle, count in _CONES:
        tilt = np.radians(angle)
        for turn in 2 * np.pi * np.arange(count) / count:
            rays.append(np.cos(tilt) * ways + np.sin(tilt) * (np.cos(turn) * first + np.sin(turn) * second))
            cosines.append(np.cos(tilt))
    starts = np.broadcast_to((points + _LIFT_M * ways)[:, None], (len(points), len(rays), 3))
    cast = np.concatenate([starts, np.stack(rays, axis=1)], axis=2).reshape(-1, 6).astype(np.float32)
    found, shape = scene.cast_rays(cast, nthreads=1), (len(points), len(cosines))
    hit = found["t_hit"].numpy().astype(np.float64)
    facet = found["primitive_ids"].numpy().astype(np.int64)  # where a ray hits nothing, beyond the last one
    return np.minimum(hit, _FAR_M).reshape(shape), np.array(cosines), facet.reshape(shape)
