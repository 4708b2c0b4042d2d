"""Checks on a closed mesh: no crack, no flipped face, no face through another."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import open3d
import trimesh

from pipeline.errors import GeometryError
from pipeline.types import Mesh

_TOUCH_M = 1e-9  # faces that come no deeper than this touch, as neighbours do
_END_SHARE = 1e-3  # of an edge: its ends touch its own faces
_ROUNDS = 64
_AT_ONCE = 200_000  # edges: a few at a time are in memory
_tensor: Any = open3d.core.Tensor


@dataclass(frozen=True)
class MeshReport:
    """What was found of a closed mesh."""

    faces: int
    vertices: int
    volume_m3: float
    area_m2: float
    watertight: bool
    winding_consistent: bool
    self_intersecting: bool


def join_meshes(pieces: dict[str, Mesh]) -> tuple[np.ndarray, np.ndarray]:
    """Join pieces at equal vertices: returns vertices (n, 3) m and faces (m, 3)."""
    mesh = trimesh.util.concatenate([trimesh.Trimesh(m.vertices, m.faces, process=False) for m in pieces.values()])
    mesh.merge_vertices()
    return np.array(mesh.vertices), np.array(mesh.faces)


def check_mesh(vertices: np.ndarray, faces: np.ndarray) -> MeshReport:
    """Check that a mesh encloses one volume and faces inwards.

    Raises
    ------
    GeometryError
        If the mesh has a crack, a flipped face, a face through another (the message says where), or faces outwards.
    """
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    crossings = find_crossings(vertices, faces)
    report = MeshReport(
        faces=len(faces),
        vertices=len(vertices),
        volume_m3=round(-float(mesh.volume), 3),
        area_m2=round(float(mesh.area), 3),
        watertight=bool(mesh.is_watertight),
        winding_consistent=bool(mesh.is_winding_consistent),
        self_intersecting=len(crossings) > 0,
    )
    wrong = [
        text
        for text, found in (
            ("has a crack", not report.watertight),
            ("has flipped faces", not report.winding_consistent),
            (f"cuts itself near {crossings[:1].round(2).tolist()}", report.self_intersecting),
            ("faces outwards", report.volume_m3 <= 0),
        )
        if found
    ]
    if wrong:
        raise GeometryError(f"surface: the closed mesh {' and '.join(wrong)} ({report.faces} faces)")
    return report


def find_crossings(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the places (k, 3) m where an edge goes through a face that shares no corner with it.

    Two faces of a mesh that cut each other always do so at an edge of one. Every edge is cast as a ray, in 32 bits, and
    each hit is tested again in 64; a ray that only grazes a face goes on behind it.
    """
    scene = open3d.t.geometry.RaycastingScene()
    origin = vertices.mean(axis=0)
    scene.add_triangles(_tensor((vertices - origin).astype(np.float32)), _tensor(faces.astype(np.uint32)))
    edges = _edges(faces)
    parts = [edges[i : i + _AT_ONCE] for i in range(0, len(edges), _AT_ONCE)]
    with ThreadPoolExecutor(2) as pool:
        found = pool.map(lambda part: _crossed_by(part, scene, origin, vertices, faces), parts)
        return np.concatenate([np.zeros((0, 3)), *found])


def _crossed_by(edges: np.ndarray, scene: Any, origin: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> Any:
    """Return the places (k, 3) m where edges (n, 2) go through faces."""
    done = np.full(len(edges), _END_SHARE)
    places = [np.zeros((0, 3))]
    for _ in range(_ROUNDS):
        start, along = vertices[edges[:, 0]] - origin, vertices[edges[:, 1]] - vertices[edges[:, 0]]
        rays = np.column_stack([start + done[:, None] * along, along]).astype(np.float32)
        found = scene.cast_rays(_tensor(rays))
        at = done + found["t_hit"].numpy()
        hit = at < 1 - _END_SHARE
        if not hit.any():
            break
        edges, at = edges[hit], at[hit]
        face = faces[found["primitive_ids"].numpy()[hit]]
        own = np.logical_or.reduce([corner == end for corner in face.T for end in edges.T])
        ends = vertices[edges]
        through = ~own & _goes_through(ends[:, 0], ends[:, 1], vertices[face])
        places.append(ends[through, 0] + at[through, None] * (ends[through, 1] - ends[through, 0]))
        edges, done = edges[~through], at[~through] + _END_SHARE
    return np.concatenate(places)


def _edges(faces: np.ndarray) -> np.ndarray:
    """Return every edge once (n, 2); by sorting, as numpy's `unique` is slow on millions of whole numbers."""
    ends = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    key = np.sort((ends.min(axis=1) << 32) | ends.max(axis=1))
    key = key[np.diff(key, prepend=-1) > 0]
    return np.column_stack([key >> 32, key & 0xFFFFFFFF])


def _goes_through(start: np.ndarray, end: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return (n,) whether segments cross triangles (n, 3, 3) inside both, in 64 bits; what only touches does not."""
    origin, side, other = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(side, other)
    doubled = np.maximum(np.einsum("ni,ni->n", normal, normal), 1e-30)
    low, high = (np.einsum("ni,ni->n", p - origin, normal) / np.sqrt(doubled) for p in (start, end))
    apart = (np.minimum(low, high) < -_TOUCH_M) & (np.maximum(low, high) > _TOUCH_M)
    share = np.divide(low, low - high, out=np.zeros(len(low)), where=apart)
    point = start + share[:, None] * (end - start) - origin
    v = np.einsum("ni,ni->n", np.cross(point, other), normal) / doubled
    w = np.einsum("ni,ni->n", np.cross(side, point), normal) / doubled
    return apart & (v > _TOUCH_M) & (w > _TOUCH_M) & (v + w < 1 - _TOUCH_M)
