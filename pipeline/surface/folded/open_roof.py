"""Holes in the rough roof where shafts come down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from minexplore.floors.floor import Floor
from minexplore.floors.stretch import KNEE_M
from pipeline.geometry.floor.holes import cut_hole, faces_over
from pipeline.geometry.openings.shaft_parts import sections_shown
from pipeline.remarks import warn_user
from pipeline.surface.mesh.rough import RoughSurface
from pipeline.surface.mesh.simplify import SurfaceMesh
from pipeline.types import Openings


def open_roof(rough: RoughSurface, openings: Openings, floor: Floor) -> RoughSurface:
    """Return a rough surface, in the plan, with holes where shafts come through it.

    A shaft over which rock hangs as low as robots are is left closed, and it is printed where. The hole of a raise is
    made smaller first, by up to 0.3 m all round: in a narrow drift rock of its walls is in the way.
    """
    mesh = rough.mesh
    for opening in openings.shafts:
        sections = sections_shown(opening, floor)
        if not sections:
            continue
        hole = next((section for section in sections if not _hangs_low(mesh, section)), None)
        if hole is None:
            x, y = np.mean(opening.outline_m, axis=0) - floor.offset_m[opening.plan_sheet]
            warn_user(f"surface: the rock under the shaft at ({x:.1f}, {y:.1f}) shows no hole")
            continue
        cut = cut_hole(mesh.vertices, mesh.faces, hole)
        mesh = SurfaceMesh(cut.points, cut.faces, mesh.piece[cut.of_face], mesh.source[cut.near])
    return replace(rough, mesh=mesh)


def _hangs_low(mesh: SurfaceMesh, hole: np.ndarray) -> bool:
    """Return whether rock over a hole (k, 2) m reaches as low as robots are."""
    over = mesh.faces[faces_over(mesh.vertices, mesh.faces, hole)]
    return bool(mesh.vertices[over, 2].min(initial=np.inf) < KNEE_M)
