"""The surveyed floors along legs: what is under them in a mesh, and a mesh that has an edge along each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot

import numpy as np

from pipeline.geometry.ray_scene import ray_scene
from pipeline.volume.folded.mesh_cuts import MeshCuts
from pipeline.volume.folded.plan_weights import plan_weights
from pipeline.volume.folded.steps import DEEPEST_M
from pipeline.volume.network import NearLegs, SurveyNetwork
from pipeline.volume.union import Label, Volume

_SAMPLE_M = 0.05  # along a leg: the union's triangles may be as small
_OWN_FLOOR_M = 0.01  # of a steep leg: a floor that is deeper is that of another
_PLUMB = 0.1  # of a facet's normal: so steep a facet has hardly an area seen from above
_ON_LINE_M = 0.01  # seen from above: a vertex so near a leg is on it


@dataclass(frozen=True)
class AlongLegs:
    """Places on surveyed floors: the facet (n,) under each, the weights (n, 3) of its corners, height, and leg (n,)."""

    facet: np.ndarray
    weights: np.ndarray
    height_m: np.ndarray
    shot: np.ndarray


def leg_floor_samples(network: SurveyNetwork, shots: np.ndarray, step_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, 3) m on the surveyed floors along some shots, both ends among them, and their shots (n,)."""
    floors, lengths = network.floors_m[shots], network.lengths_m[shots]
    counts = np.maximum(2, np.ceil(lengths / step_m).astype(int) + 1)
    shares = np.concatenate([np.linspace(0, 1, count) for count in counts]) if len(shots) else np.zeros(0)
    number = np.repeat(np.arange(len(shots)), counts)
    return floors[number, 0] + shares[:, None] * (floors[number, 1] - floors[number, 0]), shots[number]


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

    A place counts if the first facet under it is floor, at most `DEEPEST_M` below the surveyed floor. If the floor is
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
    good = (hit >= 0) & is_floor[hit] & (places[:, 2] - height < np.where(meets, DEEPEST_M, _OWN_FLOOR_M))
    weights = plan_weights(volume.vertices, volume.faces[hit[good]], places[good])
    return AlongLegs(hit[good], weights, places[good, 2], owner[good])


def with_leg_lines(volume: Volume, network: SurveyNetwork, along: AlongLegs) -> Volume:
    """Return the mesh with vertices where legs end on floors and edges along the legs, seen from above.

    A facet that a leg crosses is fixed along the line and turns about it: where a wall is 8 cm beside a leg, 40 cm at
    the wall were 4 m on the other side.
    """
    some = np.zeros(len(volume.faces), bool)
    some[along.facet] = True
    mesh, parts = MeshCuts(volume, some), dict[int, list[int]]()
    is_floor = volume.label == Label.FLOOR
    order = np.argsort(along.shot, kind="stable")
    shots, starts = np.unique(along.shot[order], return_index=True)
    for shot, under in zip(shots.tolist(), np.split(order, starts[1:]), strict=True):
        line = network.floors_m[shot][:, :2].tolist()
        left = [part for facet in np.unique(along.facet[under]).tolist() for part in parts.setdefault(facet, [facet])]
        while left:
            new = _part_at(mesh, is_floor, left.pop(), line)
            left += [part for part in new if is_floor[mesh.parent(part)]]
            for part in new:
                known = parts.setdefault(mesh.parent(part), [mesh.parent(part)])
                known += [part] if part not in known else []
    vertices, faces, parent = mesh.mesh()
    return replace(volume, vertices=vertices, faces=faces, source=volume.source[parent], label=volume.label[parent])


def _part_at(mesh: MeshCuts, is_floor: np.ndarray, facet: int, line: list[list[float]]) -> list[int]:
    """Part a facet at an end of a line in it, or where the line crosses an edge between floors; return the parts."""
    (x, y), (u, v) = line
    face = mesh.corners[facet]
    corners = [mesh.place(k) for k in face]
    for end in line:
        if _depth_m(corners, end) > _ON_LINE_M:
            return mesh.part_facet(facet, [*end, _height(corners, end)])
    length = max(hypot(u - x, v - y), 1e-9)
    beside = [((u - x) * (p[1] - y) - (v - y) * (p[0] - x)) / length for p in corners]
    for i in range(3):
        one, two, (p, q) = beside[i], beside[i - 2], (corners[i], corners[i - 2])
        if one * two >= 0 or min(abs(one), abs(two)) < _ON_LINE_M:
            continue
        share = one / (one - two)
        place = [(1 - share) * p[k] + share * q[k] for k in range(3)]
        at = ((place[0] - x) * (u - x) + (place[1] - y) * (v - y)) / length
        across = mesh.across(face[i], face[i - 2])
        if not -_ON_LINE_M < at < length + _ON_LINE_M or across is None or not is_floor[mesh.parent(across)]:
            continue
        if min(share, 1 - share) * hypot(q[0] - p[0], q[1] - p[1]) > _ON_LINE_M:
            return mesh.part_edge(face[i], face[i - 2], place)
    return []


def _depth_m(corners: list[list[float]], place: list[float]) -> float:
    """Return how far, m, a place is inside a triangle, seen from above; negative outside."""
    found = []
    for p, q in zip(corners, corners[1:] + corners[:1], strict=True):
        way = (q[0] - p[0], q[1] - p[1])
        found.append(((place[0] - p[0]) * way[1] - (place[1] - p[1]) * way[0]) / max(hypot(*way), 1e-9))
    return min(found)  # normals of floors point down: their corners go round to the right


def _height(corners: list[list[float]], place: list[float]) -> float:
    """Return the height, m, of a triangle at a place in it."""
    places = np.array(corners)
    weights = plan_weights(places, np.array([[0, 1, 2]]), np.array([place]))
    return float(weights[0] @ places[:, 2])
