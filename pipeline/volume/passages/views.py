"""What was seen from stations: splays measure that the way to their ends is free.

A view is a solid about a station, whose surface goes through the ends of its splays. In other directions it is as far
away as the splays beside them say, and near the station where there are none. Views widen passages where these stop a
splay. Floors to drive on stay, with a sill about them.
"""

from __future__ import annotations

import manifold3d
import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import ConvexHull

from pipeline.geometry.ray_scene import ray_scene
from pipeline.volume.network import SurveyNetwork

SILL_M = 0.15  # over floors, where views begin: robots drive out of a passage nowhere
BESIDE_M = 0.3  # about floors, as far as the sill goes: beyond it views may be deeper
_DIRECTIONS = 40  # about 30 deg from one to the next
_REACH_RAD = 0.7  # from a splay, as far as it says where the wall is
_BESIDE_RAD = 0.17  # from a splay, at least, in other directions
_PARALLEL_RAD = 0.035  # of splays, of which the shortest counts: it ends at what is before the others
_ALONE = 0.5  # weight of the station itself, beside those of the splays
_LEAST_M = 0.05  # of a view in any direction, and of a splay
_ROCK = 1.3  # of the sections of passages that are not near along the survey: views end before these
_DEEP_M = 100.0  # under floors, where no view goes
_LEAST_M2 = 1e-12  # of a line
_SHORT_M = 0.1  # before the end of a splay, where a passage stops it
_FLOOR_NZ = -0.7  # of the normal of a floor, which no splay moves
_AHEAD_M = 0.02  # of a station, where rays begin: it may be on the wall behind it
_START_M = 0.01  # between the start of a splay and its station


def with_views(
    passages: manifold3d.Manifold, network: SurveyNetwork, legs: list[tuple[np.ndarray, bool]], numbers: dict[int, int]
) -> manifold3d.Manifold:
    """Return the passages with views of the splays that their walls stop.

    Parameters
    ----------
    passages : Manifold
        The solid of legs and stations.
    network : SurveyNetwork
    legs : list of ((n, k, 3) float64, bool)
        The sections of each leg, m, and whether it is flat enough to drive on.
    numbers : dict
        The numbers of the legs next to the views' facets are entered by manifold3d's.
    """
    if not len(network.splays_m):
        return passages
    stopped = _stopped(passages, network.splays_m)
    found = [passages]
    shots, row = np.unique(np.sort(network.shots, axis=1), axis=0, return_index=True)
    links = coo_array((network.lengths_m[row], shots.T), (len(network.places_m),) * 2).tocsr()
    starts, station = np.unique(network.splays_m[:, 0].round(4), axis=0, return_inverse=True)
    station = station.reshape(-1)
    for number in np.unique(station[stopped]).tolist():
        away, own = np.linalg.norm(network.places_m - starts[number], axis=1), station == number
        if away.min() <= _START_M and away.argmin() in shots:
            steps = np.diff(network.splays_m[own], axis=1)[:, 0]
            found += _view(network, links, int(away.argmin()), steps, stopped[own], legs, numbers)
    return manifold3d.Manifold.batch_boolean(found, manifold3d.OpType.Add)


def _stopped(passages: manifold3d.Manifold, splays_m: np.ndarray) -> np.ndarray:
    """Return which splays (k, 2, 3) m end beyond a wall or a roof of passages."""
    mesh = passages.to_mesh64()
    vertices, faces = np.array(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, np.int64)
    step = np.diff(splays_m, axis=1)[:, 0]
    length = np.maximum(np.linalg.norm(step, axis=1, keepdims=True), _LEAST_M)
    ahead = step / length
    rays = np.column_stack([splays_m[:, 0] + _AHEAD_M * ahead, ahead]).astype(np.float32)
    hit = ray_scene(vertices, faces, 1).cast_rays(rays, nthreads=1)
    normal = -hit["primitive_normals"].numpy().astype(float)
    normal *= np.sign(np.sum(normal * ahead, axis=1, keepdims=True))  # out of the free space
    found: np.ndarray = hit["t_hit"].numpy() < length[:, 0] - _AHEAD_M - _SHORT_M
    return found & (normal[:, 2] > _FLOOR_NZ)


def _view(
    network: SurveyNetwork,
    links: csr_array,
    station: int,
    steps: np.ndarray,
    stopped: np.ndarray,
    legs: list[tuple[np.ndarray, bool]],
    numbers: dict[int, int],
) -> list[manifold3d.Manifold]:
    """Return the view about the `stopped` splays among steps (k, 3) m from a station; none if none counts."""
    place, length = network.places_m[station], np.linalg.norm(steps, axis=1)
    ways = dijkstra(links, directed=False, indices=station, limit=float(length.max()))
    near = np.flatnonzero(np.isfinite(ways)[network.shots].any(axis=1))
    others = np.setdiff1d(np.flatnonzero(_ways_m(network.ends_m, place[None])[0] < 2 * length.max()), near)
    counts = length > _LEAST_M
    stopped, steps = stopped[counts], steps[counts]
    if not stopped.any():
        return []
    corners, faces = star(steps, stopped)
    row = _ways_m(network.ends_m[near], (place + corners)[faces].mean(axis=1)).argmin(axis=1)
    view = _of_legs(place + corners, faces, near[row], numbers)
    under = [(shot, _ground(network, shot)) for shot in near.tolist() if legs[shot][1]]
    for shot in others.tolist():
        corners = legs[shot][0].reshape(-1, 3)
        under.append((shot, corners.mean(axis=0) + _ROCK * (corners - corners.mean(axis=0))))
    bodies = [view]
    for shot, points in under:
        bodies.append(manifold3d.Manifold.hull_points(points).as_original())
        numbers[bodies[-1].original_id()] = shot
    return [manifold3d.Manifold.batch_boolean(bodies, manifold3d.OpType.Subtract)]


def star(steps: np.ndarray, stopped: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (v, 3) m and the facets (f, 3) of a view about those splays (k, 3) m that are `stopped` (k,).

    Every corner is seen from the station, so that the surface does not cross itself. The facets join the directions
    that are next to each other.
    """
    length = np.linalg.norm(steps, axis=1)
    ways = steps / length[:, None]
    kept: list[int] = []
    for k in np.argsort(length, kind="stable").tolist():
        if (ways[kept] @ ways[k]).max(initial=-1.0) < np.cos(_PARALLEL_RAD):
            kept.append(k)
    beside = ways[kept] @ ways[stopped].T > np.cos(_REACH_RAD)
    length, ways = length[kept][beside.any(axis=1)], ways[kept][beside.any(axis=1)]
    number = np.arange(_DIRECTIONS) + 0.5  # along a spiral over the sphere
    up, turn = 1 - 2 * number / _DIRECTIONS, np.pi * (1 + 5**0.5) * number
    level = np.sqrt(1 - up**2)
    others = np.column_stack([level * np.cos(turn), level * np.sin(turn), up])
    apart = np.arccos(np.clip(others @ ways.T, -1, 1))
    free = apart.min(axis=1) > _BESIDE_RAD
    others, apart = others[free], apart[free]
    weight = np.clip(1 - apart / _REACH_RAD, 0, None) ** 2 / apart
    far = np.maximum((weight * length).sum(axis=1) / (weight.sum(axis=1) + _ALONE), _LEAST_M)
    ways, length = np.concatenate([ways, others]), np.concatenate([length, far])
    faces = ConvexHull(ways).simplices
    a, b, c = np.moveaxis(ways[faces], 1, 0)
    inward = np.einsum("fd,fd->f", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward, ::-1]
    return ways * length[:, None], faces


def _of_legs(corners: np.ndarray, faces: np.ndarray, legs: np.ndarray, numbers: dict[int, int]) -> manifold3d.Manifold:
    """Return the solid of facets of some legs (f,); enter its numbers."""
    order = np.argsort(legs, kind="stable")
    kinds, first = np.unique(legs[order], return_index=True)
    begin = manifold3d.Manifold.reserve_ids(len(kinds))
    numbers |= {begin + n: leg for n, leg in enumerate(kinds.tolist())}
    mesh = manifold3d.Mesh64(
        corners,
        faces[order].astype(np.uint64),
        run_index=3 * np.append(first, len(faces)),
        run_original_id=begin + np.arange(len(kinds)),
    )
    return manifold3d.Manifold(mesh)


def _ground(network: SurveyNetwork, shot: int) -> np.ndarray:
    """Return the corners (8, 3) m of the ground under a leg's floor and a little beyond it, up to the sill."""
    floors, across, walls = network.floors_m[shot], network.across[shot], network.lrud_m[shot, :, :2] + BESIDE_M
    ahead = floors[1, :2] - floors[0, :2]
    ahead *= BESIDE_M / np.linalg.norm(ahead)
    ends = floors[:, :2] + np.array([-ahead, ahead])
    corners = np.concatenate([ends + walls[:, :1] * across, (ends - walls[:, 1:] * across)[::-1]])
    high = floors[[0, 1, 1, 0], 2] + SILL_M
    return np.concatenate([np.column_stack([corners, high - deep]) for deep in (0.0, _DEEP_M)])


def _ways_m(ends_m: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return how far (n, m) m places (n, 3) m are from lines with ends (m, 2, 3) m."""
    start, way = ends_m[:, 0], ends_m[:, 1] - ends_m[:, 0]
    square = np.maximum((way**2).sum(axis=1), _LEAST_M2)
    share = np.clip(((places[:, None] - start) * way).sum(axis=2) / square, 0, 1)
    found: np.ndarray = np.linalg.norm(start + share[:, :, None] * way - places[:, None], axis=2)
    return found
