"""The visible rock of a volume against its collision walls: gaps, intrusion, holes, crossings, and the width left."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from minexplore.bundle import mesh_of
from minexplore.floors.volume_arrays import FacetLabel, each_of
from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.geometry.ray_scene import ray_scene
from pipeline.metrics.rock.sampling import sample_triangles
from pipeline.store.codecs import decode
from pipeline.surface.mesh.mesh_checks import join_meshes
from pipeline.types import Mesh
from pipeline.volume.union import Volume
from pipeline.volume.world.surface.crossed import places_crossed
from pipeline.volume.world.surface.narrow import Narrowest, balls_along, places_along
from pipeline.volume.world.surface.show import rock_names
from pipeline.volume.world.topology import LegNetwork

_SAMPLES = 100_000  # of the rock, by area
_ON_EDGE_M = 2e-3  # of the floor: the rock's points have 0.1 mm, its meshes 32 bits
_RAYS = 64  # from each place
_TURNED = 1e-5  # rad; at 10 m it is 0.1 mm
_LEAST_M = 0.2  # from a wall: rays begin farther away
_DIGITS = 6


def read_rock(folder: Path, names: Mapping[str, str]) -> dict[str, Mesh]:
    """Return the visible rock of a bundle, whose record lists these files."""
    return {mesh_of(name): decode(folder / name, Mesh) for name in rock_names(names)}


def measure_rock(
    volume: Volume, legs: LegNetwork, rock: Mapping[str, Mesh], rng: np.random.Generator
) -> dict[str, float]:
    """Return the figures of the visible rock of a world; without any, `shown` is 0 and there are no others.

    `gap_*` are distances from samples of the rock to the facets of the volume, `into_free_m` is the largest of those
    inside it. `open_m` is the length of the rock's border that is not on the floor's border, `bare_m` the length of the
    floor's border without rock on it. `crossings` counts places where the rock crosses itself; those where it is the
    volume's own facets are `folded`. `leaks` counts rays from the legs that end on no rock and no floor, or on a face
    from behind. `narrowest_kept` is the share of the distance to walls and roofs that is left in the middle of the
    narrowest passage: legs may run beside a wall.
    """
    if not rock:
        return {"shown": 0}
    vertices, faces = join_meshes(dict(rock))
    samples, _ = sample_triangles(vertices[faces], _SAMPLES, rng)
    inside = volume.inside
    away = inside.distance_m(samples)
    gap = np.abs(away)
    is_floor = volume.label == FacetLabel.FLOOR
    open_m, bare_m = _borders_m(vertices, faces, volume.vertices, volume.faces[is_floor])
    _, is_own = places_crossed(vertices, faces, (volume.vertices, volume.faces))
    places, _ = places_along(legs)
    narrowest = Narrowest.of(balls_along(volume, legs), volume)
    places = places[inside.distance_m(places) > _LEAST_M]
    return {
        "shown": 1,
        "facets": len(faces),
        "gap_median_m": round(float(np.median(gap)), _DIGITS),
        "gap_p95_m": round(float(np.percentile(gap, 95)), _DIGITS),
        "gap_max_m": round(float(gap.max()), _DIGITS),
        "into_free_m": round(float(away.max(initial=0.0)), _DIGITS),
        "open_m": round(open_m, _DIGITS),
        "bare_m": round(bare_m, _DIGITS),
        "crossings": int((~is_own).sum()),
        "folded": int(is_own.sum()),
        "leaks": _leaks(places, (vertices, faces), (volume.vertices, volume.faces[is_floor]), rng),
        "narrowest_kept": 1.0 if narrowest is None else round(narrowest.kept(vertices, faces)[0], _DIGITS),
    }


def _borders_m(vertices: np.ndarray, faces: np.ndarray, others: np.ndarray, floors: np.ndarray) -> tuple[float, float]:
    """Return the lengths, m, of the rock's border that is not on that of the floors, and of the floors' without rock.

    The two sides of thin rock may be one in 32 bits. They have no border then, but they stand on that of the floors.
    """
    floor = others[_border(floors)]
    near = _distance_to_edges(vertices, floor) < _ON_EDGE_M if len(floor) else np.zeros(len(vertices), bool)
    some = faces[near[faces].sum(axis=1) > 1]
    ends = np.concatenate([some[:, [k, (k + 1) % 3]] for k in range(3)])
    return _beside_m(vertices[_border(faces)], floor), _beside_m(floor, vertices[ends[near[ends].all(axis=1)]])


def _border(faces: np.ndarray) -> np.ndarray:
    """Return the edges (n, 2) that one face has alone."""
    ends = np.sort(np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)]).astype(np.int64), axis=1)
    edges, count = np.unique(ends, axis=0, return_counts=True)
    found: np.ndarray = edges[count == 1]
    return found


def _beside_m(edges: np.ndarray, others: np.ndarray) -> float:
    """Return the length, m, of those edges (n, 2, 3) whose middle third is on no other edge."""
    long = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    if not len(edges) or not len(others):
        return float(long.sum())
    pieces = np.maximum(1, np.ceil(long / 0.25)).astype(np.int64)
    number, step = each_of(pieces)
    share = (step + 0.5) / pieces[number]
    places = edges[number, 0] + share[:, None] * (edges[number, 1] - edges[number, 0])
    on = _distance_to_edges(places, others) < _ON_EDGE_M
    return float((long / pieces)[number][~on].sum())


def _distance_to_edges(places: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the distance (n,) m of places from the nearest of edges (k, 2, 3), as triangles without an area."""
    numbers = 2 * np.arange(len(edges))
    triangles = np.column_stack([numbers, numbers + 1, numbers + 1])
    return NearestFacets(edges.reshape(-1, 3), triangles, 1).query(places).distance_m


_Triangles = tuple[np.ndarray, np.ndarray]


def _scene(middle: np.ndarray, first: _Triangles, *others: _Triangles) -> Any:
    """Return a scene in which each mesh is a geometry."""
    scene = ray_scene(first[0] - middle, first[1], 1)
    for vertices, faces in others:
        scene.add_triangles((vertices - middle).astype(np.float32), faces.astype(np.uint32))
    return scene


def _leaks(places: np.ndarray, rock: _Triangles, floors: _Triangles, rng: np.random.Generator) -> int:
    """Return how many rays from places (n, 3) m miss the rock and the floors, or meet the rock from behind.

    In 32 bits a ray may pass between two faces at their common edge, about once in a million. So one that leaks is
    turned by `_TURNED` to four sides, and counts if one of those leaks as well.
    """
    middle = rock[0].mean(axis=0)
    ways = rng.standard_normal((len(places), _RAYS, 3))
    ways /= np.linalg.norm(ways, axis=2, keepdims=True)
    starts = np.broadcast_to((places - middle)[:, None], ways.shape)
    rays = np.concatenate([starts, ways], axis=2).reshape(-1, 6).astype(np.float32)
    scene = _scene(middle, rock, floors)
    doubtful = rays[_are_leaks(scene, rays)]
    side = np.cross(doubtful[:, 3:], np.eye(3)[np.abs(doubtful[:, 3:]).argmin(axis=1)])
    sides = np.stack([side, -side, other := np.cross(doubtful[:, 3:], side), -other], axis=1)
    again = np.repeat(doubtful[:, None], 4, axis=1)
    again[:, :, 3:] += _TURNED * sides / np.linalg.norm(sides, axis=2, keepdims=True)
    return int(_are_leaks(scene, again.reshape(-1, 6)).reshape(-1, 4).any(axis=1).sum())


def _are_leaks(scene: Any, rays: np.ndarray) -> np.ndarray:
    """Return which rays (n, 6) miss all, or meet the first geometry from behind."""
    found = scene.cast_rays(rays.astype(np.float32), nthreads=1)
    missed = ~np.isfinite(found["t_hit"].numpy())
    behind = (found["primitive_normals"].numpy() * rays[:, 3:]).sum(axis=1) > 0
    leaks: np.ndarray = missed | behind & (found["geometry_ids"].numpy() == 0)
    return leaks
