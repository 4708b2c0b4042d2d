"""Build the rough surface of a mine from parameters, workings and relief."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from shapely.geometry.base import BaseGeometry

from minesurveys.remarks import warn_user
from pipeline.errors import InputError
from pipeline.params.surface import RoughParams, SurfaceParams
from pipeline.store.codecs import Bundle, encode
from pipeline.surface.chunks import cut_chunks
from pipeline.surface.mesh.lattice import CrossSection, Lattice, lay_lattice
from pipeline.surface.mesh.rough import RoughSurface, displace_lattice
from pipeline.surface.mesh.simplify import Mesher, Simplification
from pipeline.surface.mesh.walls import lay_walls
from pipeline.surface.relief.joints import JointedRock, relief_of_joints
from pipeline.surface.relief.noise import Modulation, Relieved, relief_of_noise
from pipeline.surface.relief_source import Relief, bounds_of
from pipeline.types import DriftNetwork

_WIDEST_M = 0.5
_STEP = 1.02  # by which spacings are widened again


def cross_section(params: SurfaceParams, height_m: float) -> CrossSection:
    """Return the cross-section of the workings, m."""
    return CrossSection(height_m, params.floor_chamfer_m, params.roof_chamfer_m, params.rough.arch_half_span_m)


def widen_spacing(params: SurfaceParams, free: BaseGeometry, height_m: float) -> SurfaceParams:
    """Widen both spacings until the rough surface has at most `most_faces`; see `within_most_faces`."""
    wall_m2 = free.length * (height_m - cross_section(params, height_m).arch_rise_m)

    def faces(rough: RoughParams) -> float:
        return 2 * wall_m2 / rough.spacing_m**2 + 2 * free.area / rough.roof_spacing_m**2

    rough = within_most_faces(params.rough, faces, f"{free.area:.0f} m2 of workings")
    return params.model_copy(update={"rough": rough})


def within_most_faces(rough: RoughParams, faces_of: Callable[[RoughParams], float], rock: str) -> RoughParams:
    """Widen both spacings until the rock has `most_faces` within a per cent, and print the new spacings.

    Raises
    ------
    InputError
        If a spacing would exceed 0.5 m.
    """
    most, faces, wide = rough.most_faces, faces_of(rough), rough
    if most is None or faces <= most:
        return rough
    wider = math.sqrt(faces / most)
    while wide is rough or (faces_of(wide) > 1.01 * most and max(wide.spacing_m, wide.roof_spacing_m) <= _WIDEST_M):
        spacing, roof_spacing = (round(wider * s, 3) for s in (rough.spacing_m, rough.roof_spacing_m))
        wide = rough.model_copy(update={"spacing_m": spacing, "roof_spacing_m": roof_spacing})
        wider *= _STEP
    size = f"{rock} would need {faces / 1e6:.1f} million faces of rock"
    if max(wide.spacing_m, wide.roof_spacing_m) > _WIDEST_M:
        raise InputError(
            f"surface: {size}, surface.rough.most_faces is {most}; "
            "build a part of the mine, or none of the rock (preset=light)"
        )
    warn_user(
        f"{size}, more than surface.rough.most_faces = {most}; points are {wide.spacing_m:g} m "
        f"apart instead of {rough.spacing_m:g} m, too far for the limits on texture",
        of="surface",
        option="surface.rough.most_faces",
    )
    return wide


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
    return displace_lattice(Mesher(lattice, simplification), wanted_m(rough, lattice, relief), bounds_of(rough))


def wanted_m(rough: RoughParams, rock: Relieved, relief: Relief) -> np.ndarray:
    """Return the displacement (n,) m before bounds; points that do not move, as they have no direction, have 0."""
    if isinstance(relief, JointedRock):
        wanted, used = np.zeros(len(rock.vertices)), rock.direction.any(axis=1)
        wanted[used] = relief_of_joints(rock.vertices[used], rock.direction[used], relief, rough.seed)
        return wanted
    modulation = Modulation(rough.modulation_m, rough.modulation_spread)
    return relief_of_noise(rock, *relief, modulation, np.random.default_rng(rough.seed))


def chunk_files(rough: RoughSurface, params: SurfaceParams) -> Bundle:
    """Return the rough surface's chunks as `NAME.msh`."""
    build, texture = params.rough, params.texture
    shading = build.normals, build.crease_deg
    chunks = cut_chunks(rough, build.tile_m, texture.repeat_m, *shading, texture.tether_m)
    return {f"{name}.msh": encode(Path(f"{name}.msh"), mesh) for name, mesh in chunks.items()}
