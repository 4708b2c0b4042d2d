"""How much room there is about each point of a volume's walls: across the passage, and through the rock behind."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from minexplore.floors.volume_arrays import VolumeFacets
from pipeline.geometry.ray_scene import ray_scene
from pipeline.surface.mesh.displacement import Room
from pipeline.surface.mesh.lattice import WALL
from pipeline.surface.mesh.walls import smoothstep
from pipeline.volume.world.surface.fine import FineRock
from pipeline.volume.world.surface.narrow import NO_BALLS, Balls

_LIFT_M = 2e-3  # of the rays' starts off the surface, over the rounding of 32 bits
_CONES = ((0.0, 1), (35.0, 6), (65.0, 6))  # angle from the way across, deg, and rays
_ACROSS = (0, 1, 4)  # of these rays: from walls they lie level, and the median of the three measures the width
_STEEP = 0.9  # of a way's height: it has no level way across
_AT_ONCE = 100_000  # points
_UPRIGHT = 0.3  # height of an upright wall's normal: higher up, walls lean in
_NARROWEST = 5  # per cent of the walls' points: corners and noses of rock are narrower than any passage
_REACH_M = 0.36  # beyond a ball: relief from there could come into it
_FADE_M = 1.0  # farther away: there a wall has its own half width again, as rock that bulges at once crosses itself
_FAR_M = 100.0  # where a ray hits nothing


def room_about(rock: FineRock, volume: VolumeFacets, balls: Balls = NO_BALLS) -> Room:
    """Return half widths, and the largest balls that touch each point in the workings and in the rock.

    Rays in a cone about the way into the workings, and about the way into the rock, find both. The ball through a hit
    touches the surface. The narrowest passage has the half width that one wall in twenty has at most. In a cave of
    uneven walls these rays pass its narrowest place by: about the narrowest of the `balls` that fit in the passages,
    the half width is their radius.
    """
    middle = volume.vertices.mean(axis=0)  # rays are cast in 32 bits
    scene = ray_scene(volume.vertices - middle, volume.faces, 1)
    half, free, behind = np.full((3, len(rock.vertices)), _FAR_M)
    used = np.flatnonzero(rock.direction.any(axis=1))
    for at in range(0, len(used), _AT_ONCE):
        part = used[at : at + _AT_ONCE]
        half[part], free[part], behind[part] = _radii(scene, rock.vertices[part] - middle, rock.direction[part])
    narrow = balls.narrowest
    if len(narrow.radii_m):
        far, number = cKDTree(narrow.middles_m).query(rock.vertices)
        radius = narrow.radii_m[number]
        own = smoothstep((far - radius - _REACH_M) / _FADE_M)
        half = np.minimum(half, radius + (half - radius) * own)
    return Room(half, free, behind, np.zeros(len(half)), _narrowest(rock, half))


def _radii(scene: Any, points: np.ndarray, inward: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return half width, ball in the workings and ball in the rock, each (n,) m."""
    free, along = _distances(scene, points, inward)
    behind, _ = _distances(scene, points, -inward)
    half = np.median((free * along)[:, _ACROSS], axis=1) / 2
    return half, (free / along).min(axis=1) / 2, (behind / along).min(axis=1) / 2


def _distances(scene: Any, points: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances (n, rays) m along the cones' rays, and the cosines (rays,) of their angles."""
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
    hit = scene.cast_rays(cast, nthreads=1)["t_hit"].numpy().astype(np.float64)
    return np.minimum(hit, _FAR_M).reshape(len(points), -1), np.array(cosines)


def _narrowest(rock: FineRock, half: np.ndarray) -> float:
    on_wall = np.unique(rock.faces[rock.piece == WALL])
    on_wall = on_wall[(np.abs(rock.direction[on_wall, 2]) < _UPRIGHT) & ~rock.is_fixed[on_wall]]
    return float(np.percentile(half[on_wall], _NARROWEST)) if len(on_wall) else _FAR_M
