"""Holes in the rough roof where shafts come down."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from minexplore.floor import Floor
from minexplore.stretch import KNEE_M
from pipeline.geometry.holes import cut_hole, faces_over
from pipeline.geometry.shaft_parts import section_below
from pipeline.surface.rough import RoughSurface
from pipeline.surface.simplify import SurfaceMesh
from pipeline.types import Openings


def open_roof(rough: RoughSurface, openings: Openings, floor: Floor) -> RoughSurface:
    """Return a rough surface, in the plan, with holes where shafts come through it.

    A shaft over which rock hangs as low as robots are is left closed, and it is printed where.
    """
    mesh = rough.mesh
    for opening in openings.shafts:
        hole = section_below(opening, floor)
        if hole is None:
            continue
        over = mesh.faces[faces_over(mesh.vertices, mesh.faces, hole)]
        if mesh.vertices[over, 2].min(initial=np.inf) < KNEE_M:
            x, y = np.mean(opening.outline_m, axis=0) - floor.offset_m[opening.sheet]
            print(f"surface: the rock under the shaft at ({x:.1f}, {y:.1f}) shows no hole", file=sys.stderr)
            continue
        cut = cut_hole(mesh.vertices, mesh.faces, hole)
        mesh = SurfaceMesh(cut.points, cut.faces, mesh.piece[cut.of_face], mesh.source[cut.near])
    return replace(rough, mesh=mesh)
