"""Build the rough surface of a mine from parameters, workings and relief."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from shapely.geometry.base import BaseGeometry

from minesurveys.remarks import warn_user
from pipeline.errors import InputError
from pipeline.params.surface import SurfaceParams
from pipeline.store.codecs import Bundle, encode
from pipeline.surface.chunks import cut_chunks
from pipeline.surface.mesh.lattice import CrossSection, Lattice, lay_lattice
from pipeline.surface.mesh.rough import RoughSurface, displace_lattice
from pipeline.surface.mesh.simplify import Mesher, Simplification
from pipeline.surface.mesh.walls import lay_walls
from pipeline.surface.relief.joints import JointedRock, relief_of_joints
from pipeline.surface.relief.noise import Modulation, relief_of_noise
from pipeline.surface.relief_source import Relief, bounds_of
from pipeline.types import DriftNetwork

_WIDEST_M = 0.5


def cross_section(params: SurfaceParams, height_m: float) -> CrossSection:
    """Return the cross-section of the workings, m."""
    return CrossSection(height_m, params.floor_chamfer_m, params.roof_chamfer_m, params.rough.arch_half_span_m)


def widen_spacing(params: SurfaceParams, free: BaseGeometry, height_m: float) -> SurfaceParams:
    """Widen both spacings until the rough surface has at most `most_faces`, and print the new spacings.

    Raises
    ------
    InputError
        If a spacing would exceed 0.5 m.
    """
    rough, profile = params.rough, cross_section(params, height_m)
    wall_m2 = free.length * (height_m - profile.arch_rise_m)
    faces = 2 * wall_m2 / rough.spacing_m**2 + 2 * free.area / rough.roof_spacing_m**2
    if rough.most_faces is None or faces <= rough.most_faces:
        return params
    wider = math.sqrt(faces / rough.most_faces)
    spacing, roof_spacing = (round(wider * s, 3) for s in (rough.spacing_m, rough.roof_spacing_m))
    size = f"{free.area:.0f} m2 of workings would need {faces / 1e6:.1f} million faces of rock"
    if max(spacing, roof_spacing) > _WIDEST_M:
        raise InputError(
            f"surface: {size}, surface.rough.most_faces is {rough.most_faces}; "
            "build a part of the mine, or none of the rock (preset=light)"
        )
    warn_user(
        f"{size}, more than surface.rough.most_faces = {rough.most_faces}; points are {spacing:g} m "
        f"apart instead of {rough.spacing_m:g} m, too far for the limits on texture",
        of="surface",
        option="surface.rough.most_faces",
    )
    return params.model_copy(
        update={"rough": rough.model_copy(update={"spacing_m": spacing, "roof_spacing_m": roof_spacing})}
    )


def lay_rough_lattice(
    params: SurfaceParams, free: BaseGeometry, network: DriftNetwork | None, height_m: float
) -> Lattice:
    """Lay the lattice of the workings by the configured spacings and cross-section.

    Raises
    ------
    GeometryError
        If two walls are nearer to each other than the spacing.
    """
    rough = params.rough
    walls = lay_walls(free, rough.spacing_m, network, rough.thinnest_rock_m)
    return lay_lattice(walls, cross_section(params, height_m), rough.spacing_m, rough.roof_spacing_m)


def build_rough_surface(params: SurfaceParams, lattice: Lattice, relief: Relief) -> RoughSurface:
    """Build the rough surface from jointed rock or from the noise of walls and roof.

    Raises
    ------
    GeometryError
        If the mesh intersects itself after all repairs.
    """
    rough = params.rough
    simplification = Simplification(rough.kept_share, rough.tile_m) if rough.kept_share else None
    return displace_lattice(Mesher(lattice, simplification), _wanted_m(params, lattice, relief), bounds_of(rough))


def _wanted_m(params: SurfaceParams, lattice: Lattice, relief: Relief) -> np.ndarray:
    rough = params.rough
    if isinstance(relief, JointedRock):
        return relief_of_joints(lattice.vertices, lattice.direction, relief, rough.seed)
    modulation = Modulation(rough.modulation_m, rough.modulation_spread)
    return relief_of_noise(lattice, *relief, modulation, np.random.default_rng(rough.seed))


def chunk_files(rough: RoughSurface, params: SurfaceParams) -> Bundle:
    """Return the rough surface's chunks as `NAME.msh`."""
    build, texture = params.rough, params.texture
    shading = build.normals, build.crease_deg
    chunks = cut_chunks(rough, build.tile_m, texture.repeat_m, *shading, texture.tether_m)
    return {f"{name}.msh": encode(Path(f"{name}.msh"), mesh) for name, mesh in chunks.items()}
