"""Checks on a closed shell: no crack, no flipped face, no face through another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import open3d
import trimesh

from pipeline.errors import GeometryError
from pipeline.types import Mesh

_TOUCH = 1e-9  # m: faces that come no deeper than this touch, as neighbours do


@dataclass(frozen=True)
class ShellReport:
    """What was found of a closed shell."""

    faces: int
    vertices: int
    volume_m3: float
    area_m2: float
    watertight: bool
    winding_consistent: bool
    self_intersecting: bool


def check_shell(pieces: dict[str, Mesh]) -> ShellReport:
    """Join pieces at equal vertices and check that they enclose one volume, facing inwards.

    Raises
    ------
    GeometryError
        If the shell has a crack, a flipped face, a face through another, or faces outwards.
    """
    shell = trimesh.util.concatenate([trimesh.Trimesh(m.vertices, m.faces, process=False) for m in pieces.values()])
    shell.merge_vertices()
    solid = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(np.array(shell.vertices)), open3d.utility.Vector3iVector(np.array(shell.faces))
    )
    report = ShellReport(
        faces=len(shell.faces),
        vertices=len(shell.vertices),
        volume_m3=round(-float(shell.volume), 3),
        area_m2=round(float(shell.area), 3),
        watertight=bool(shell.is_watertight),
        winding_consistent=bool(shell.is_winding_consistent),
        self_intersecting=_any_crossing(
            shell.triangles[np.asarray(solid.get_self_intersecting_triangles(), dtype=int)]
        ),
    )
    wrong = [
        text
        for text, found in (
            ("has a crack", not report.watertight),
            ("has flipped faces", not report.winding_consistent),
            ("cuts itself", report.self_intersecting),
            ("faces outwards", report.volume_m3 <= 0),
        )
        if found
    ]
    if wrong:
        raise GeometryError(f"surface: the inner shell {' and '.join(wrong)} ({report.faces} faces)")
    return report


def _any_crossing(pairs: np.ndarray) -> bool:
    """Say whether in any pair of triangles, (n, 2, 3, 3), an edge of one goes through the inside of the other.

    Open3D's test also reports neighbours that meet in nearly one plane.
    """
    pairs = pairs.reshape(-1, 2, 3, 3)
    return bool((_edges_through(pairs[:, 0], pairs[:, 1]) | _edges_through(pairs[:, 1], pairs[:, 0])).any())


def _edges_through(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Return (n,) whether an edge of triangle `one` crosses the plane of `two` inside it."""
    corner, side, other = two[:, 0], two[:, 1] - two[:, 0], two[:, 2] - two[:, 0]
    normal = np.cross(side, other)
    height = np.einsum("nij,nj->ni", one - corner[:, None], normal / np.linalg.norm(normal, axis=1, keepdims=True))
    crosses = np.zeros(len(one), dtype=bool)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        apart = (np.minimum(height[:, a], height[:, b]) < -_TOUCH) & (np.maximum(height[:, a], height[:, b]) > _TOUCH)
        share = np.divide(height[:, a], height[:, a] - height[:, b], out=np.zeros(len(one)), where=apart)
        point = one[:, a] + share[:, None] * (one[:, b] - one[:, a]) - corner
        doubled = np.einsum("ni,ni->n", normal, normal)
        v = np.einsum("ni,ni->n", np.cross(point, other), normal) / doubled
        w = np.einsum("ni,ni->n", np.cross(side, point), normal) / doubled
        crosses |= apart & (v > _TOUCH) & (w > _TOUCH) & (v + w < 1 - _TOUCH)
    return crosses
