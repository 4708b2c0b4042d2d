"""Check a closed mesh: no crack, no flipped face, no self-intersection."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.errors import GeometryError
from pipeline.geometry.ray_scene import ray_scene
from pipeline.types import Mesh

_TOUCH_M = 1e-9  # faces that overlap by no more than this only touch, as neighbours do
_END_SHARE = 1e-3  # of an edge's length, ignored at its ends, which touch its own faces
_ROUNDS = 64
_AT_ONCE = 200_000  # edges in memory at a time


@dataclass(frozen=True)
class MeshReport:
    """Counts, size and defects of a closed mesh."""

    faces: int
    vertices: int
    volume_m3: float
    area_m2: float
    watertight: bool
    winding_consistent: bool
    self_intersecting: bool


def join_meshes(pieces: dict[str, Mesh]) -> tuple[np.ndarray, np.ndarray]:
    """Join meshes at equal vertices; return vertices (n, 3) m and faces (m, 3)."""
    import trimesh  # takes half a second to load, and light worlds do without

    mesh = trimesh.util.concatenate([trimesh.Trimesh(m.vertices, m.faces, process=False) for m in pieces.values()])
    mesh.merge_vertices()
    return np.array(mesh.vertices), np.array(mesh.faces)


def check_mesh(vertices: np.ndarray, faces: np.ndarray, cast: np.ndarray | None = None) -> MeshReport:
    """Check that a mesh encloses one volume and faces inwards.

    Only the edges of the faces `cast` (k, 3) are tried for crossings, by default those of all faces.

    Raises
    ------
    GeometryError
        If the mesh has a crack or a flipped face, intersects itself (the message gives the place), or faces outwards.
    """
    crossings = find_crossings(vertices, faces, cast)
    report = report_mesh(vertices, faces, len(crossings) > 0)
    defects = [
        text
        for text, present in (
            ("has a crack", not report.watertight),
            ("has flipped faces", not report.winding_consistent),
            (f"intersects itself near {crossings[:1].round(2).tolist()}", report.self_intersecting),
            ("faces outwards", report.volume_m3 <= 0),
        )
        if present
    ]
    if defects:
        raise GeometryError(f"surface: the closed mesh {' and '.join(defects)} ({report.faces} faces)")
    return report


def report_mesh(vertices: np.ndarray, faces: np.ndarray, self_intersecting: bool) -> MeshReport:
    """Return the report on a mesh that faces inwards, and perhaps intersects itself."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    cross = np.cross(b - a, c - a)
    one, other = (np.concatenate([faces[:, (k + turn) % 3] for k in range(3)]).astype(np.int64) for turn in (0, 1))
    own, turned = np.sort(one * len(vertices) + other), np.sort(other * len(vertices) + one)
    single = bool((np.diff(own) > 0).all())
    return MeshReport(
        faces=len(faces),
        vertices=len(vertices),
        volume_m3=round(-float(np.einsum("ij,ij->", a, cross)) / 6, 3),
        area_m2=round(float(np.linalg.norm(cross, axis=1).sum()) / 2, 3),
        watertight=single and bool((own == turned).all()),
        winding_consistent=single,
        self_intersecting=self_intersecting,
    )


def find_crossings(vertices: np.ndarray, faces: np.ndarray, cast: np.ndarray | None = None) -> np.ndarray:
    """Return the places (k, 3) m where an edge crosses a face that shares no vertex with it.

    The edges are those of the faces `cast` (k, 3), by default of all faces.

    If two faces of a mesh intersect, an edge of one crosses the other. Every edge is cast as a ray in 32 bits, and each
    hit is tested again in 64 bits; if the test fails, the ray continues behind the face.
    """
    origin = vertices.mean(axis=0)
    scene = ray_scene(vertices - origin, faces)
    edges = _edges(faces if cast is None else cast)
    parts = [edges[i : i + _AT_ONCE] for i in range(0, len(edges), _AT_ONCE)]
    places = (_edge_crossings(part, scene, origin, vertices, faces) for part in parts)
    return np.concatenate([np.zeros((0, 3)), *places])


def find_shared_edges(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the middles (k, 3) m of edges that more than two faces share."""
    ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64), axis=1)
    key = np.sort((ends[:, 0] << 32) | ends[:, 1])
    shared = np.unique(key[2:][(key[2:] == key[1:-1]) & (key[1:-1] == key[:-2])])
    return (vertices[shared >> 32] + vertices[shared & 0xFFFFFFFF]) / 2


def _edge_crossings(edges: np.ndarray, scene: Any, origin: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> Any:
    """Return the places (k, 3) m where edges (n, 2) cross faces."""
    done = np.full(len(edges), _END_SHARE)
    places = [np.zeros((0, 3))]
    for _ in range(_ROUNDS):
        start, along = vertices[edges[:, 0]] - origin, vertices[edges[:, 1]] - vertices[edges[:, 0]]
        rays = np.column_stack([start + done[:, None] * along, along]).astype(np.float32)
        answer = scene.cast_rays(rays)
        at = done + answer["t_hit"].numpy()
        hit = at < 1 - _END_SHARE
        if not hit.any():
            break
        edges, at = edges[hit], at[hit]
        face = faces[answer["primitive_ids"].numpy()[hit]]
        own = np.logical_or.reduce([corner == end for corner in face.T for end in edges.T])
        ends = vertices[edges]
        through = ~own & _crosses(ends[:, 0], ends[:, 1], vertices[face])
        places.append(ends[through, 0] + at[through, None] * (ends[through, 1] - ends[through, 0]))
        edges, done = edges[~through], at[~through] + _END_SHARE
    return np.concatenate(places)


def _edges(faces: np.ndarray) -> np.ndarray:
    """Return every edge once (n, 2); by sorting, since numpy's `unique` is slow on millions of integers."""
    ends = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    key = np.sort((ends.min(axis=1) << 32) | ends.max(axis=1))
    key = key[np.diff(key, prepend=-1) > 0]
    return np.column_stack([key >> 32, key & 0xFFFFFFFF])


def _crosses(start: np.ndarray, end: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return (n,) whether segments cross the interior of triangles (n, 3, 3), in 64 bits; contact is no crossing."""
    origin = triangles[:, 0]
    side, other = triangles[:, 1] - origin, triangles[:, 2] - origin
    normal = np.cross(side, other)
    doubled = np.maximum(np.einsum("ni,ni->n", normal, normal), 1e-30)
    low, high = (np.einsum("ni,ni->n", p - origin, normal) / np.sqrt(doubled) for p in (start, end))
    opposite = (np.minimum(low, high) < -_TOUCH_M) & (np.maximum(low, high) > _TOUCH_M)
    share = np.divide(low, low - high, out=np.zeros(len(low)), where=opposite)
    point = start + share[:, None] * (end - start) - origin
    v = np.einsum("ni,ni->n", np.cross(point, other), normal) / doubled
    w = np.einsum("ni,ni->n", np.cross(side, point), normal) / doubled
    return opposite & (v > _TOUCH_M) & (w > _TOUCH_M) & (v + w < 1 - _TOUCH_M)
