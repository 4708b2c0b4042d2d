"""Checks on a closed shell: no crack, no flipped face, no face through another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import open3d
import trimesh

from pipeline.errors import GeometryError
from pipeline.types import Mesh


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
        self_intersecting=bool(solid.is_self_intersecting()),
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
