"""The work of stage 4 for a volume: the chunks of its visible rock, its texture, and a report on the mesh."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from minesurveys.remarks import warn_user
from minexplore.bundle import TOPOLOGY, VOLUME
from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.errors import InputError
from pipeline.params.surface import RoughParams, SurfaceParams
from pipeline.progress import progress
from pipeline.store.codecs import Bundle, decode, encode
from pipeline.surface.mesh.mesh_checks import MeshReport
from pipeline.surface.mesh.simplify import Simplification
from pipeline.surface.reference import measure_sources
from pipeline.surface.relief.joints import JointedRock, relief_of_joints
from pipeline.surface.relief.noise import Modulation, relief_of_noise
from pipeline.surface.relief_source import Relief, bounds_of, choose_bands, configured_rock
from pipeline.types import Image
from pipeline.volume.rock.inside import Inside
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.surface.chunks import cut_rock
from pipeline.volume.world.surface.displace import DisplacedRock, displace_rock
from pipeline.volume.world.surface.fine import FineRock, refine
from pipeline.volume.world.surface.narrow import NO_BALLS, Balls, balls_along
from pipeline.volume.world.surface.room import room_about
from pipeline.volume.world.surface.scanned import NO_RGB, NO_SCAN, ScanColours, unseen
from pipeline.volume.world.topology import LegNetwork

_WIDEST_M = 0.5
_SIMPLIFIED = 0.25  # of a chunk's side: a tile that is simplified less, as its rock would cross, is small
_WIDER = 1.02  # by which spacings are widened at a time


@dataclass(frozen=True)
class VolumeRock:
    """The chunks of the visible rock as `NAME.msh`, its texture, and a report on its mesh, closed by the floors."""

    files: Bundle
    texture: Image
    report: MeshReport


def rock_of_volume(
    params: SurfaceParams, compiled: Path, texture: Image, scan_m: np.ndarray = NO_SCAN, scan_rgb: np.ndarray = NO_RGB
) -> VolumeRock:
    """Return the visible rock of the volume in a folder of stage 3.

    Near points (n, 3) m of a scan it is the volume itself, which follows them, with their colours (n, 3), if they have
    any. Away from them, and in workings that were not scanned, it is synthetic and has the texture.

    Raises
    ------
    InputError
        If the rock would need points more than 0.5 m apart to keep within `most_faces`.
    """
    with progress("surface", 4, "steps") as done:
        volume = decode(compiled / VOLUME, VolumeFacets)
        balls = balls_along(volume, decode(compiled / TOPOLOGY, LegNetwork))
        done.update()
        rock = displaced_rock(params, volume, scan_m, balls)
        done.update()
        chunks, texture = cut_rock(rock, params, texture, ScanColours(scan_m, scan_rgb))
        done.update()
        files = {f"{name}.msh": encode(Path(f"{name}.msh"), mesh) for name, mesh in chunks.items()}
        return VolumeRock(files, texture, _report(rock))


def displaced_rock(
    params: SurfaceParams, volume: VolumeFacets, scan_m: np.ndarray = NO_SCAN, balls: Balls = NO_BALLS
) -> DisplacedRock:
    """Return the displaced rock of a volume, whose narrowest passage fits `balls`; see `rock_of_volume`."""
    rough = _widened(params.rough, volume)
    fine = refine(volume, rough.spacing_m, rough.roof_spacing_m)
    simplification = Simplification(rough.kept_share, rough.tile_m * _SIMPLIFIED) if rough.kept_share else None
    wanted, share = _wanted_m(params, fine), unseen(fine.vertices, scan_m)
    room = room_about(fine, volume, balls)
    free, foot_m = Inside(closed_volume(volume)), params.floor_chamfer_m
    rock = displace_rock(fine, wanted, room, bounds_of(rough), foot_m, simplification, free, share)
    if len(rock.crossings):
        place, count = rock.crossings[0].round(1).tolist(), len(rock.crossings)
        warn_user(
            f"in the 32 bits of meshes facets of the volume cross or touch at {count} places, the first "
            f"{place} m; the visible rock has no relief there",
            of="surface",
        )
    return rock


def _widened(rough: RoughParams, volume: VolumeFacets) -> RoughParams:
    """Return the configured spacings, or those at which the rock has at most `most_faces`, with a remark."""
    faces = _faces(volume, rough)
    if rough.most_faces is None or faces <= rough.most_faces:
        return rough
    wider, wide = 1.0, rough
    while _faces(volume, wide) > rough.most_faces and max(wide.spacing_m, wide.roof_spacing_m) <= _WIDEST_M:
        wider *= _WIDER
        spacing, roof_spacing = (round(wider * s, 3) for s in (rough.spacing_m, rough.roof_spacing_m))
        wide = rough.model_copy(update={"spacing_m": spacing, "roof_spacing_m": roof_spacing})
    area = np.linalg.norm(volume.normals[volume.label != FacetLabel.FLOOR], axis=1).sum() / 2
    size = f"{area:.0f} m2 of walls and roofs would need {faces / 1e6:.1f} million faces of rock"
    if max(wide.spacing_m, wide.roof_spacing_m) > _WIDEST_M:
        raise InputError(
            f"surface: {size}, surface.rough.most_faces is {rough.most_faces}; build a part of the mine, or none of "
            "the rock (preset=light)"
        )
    warn_user(
        f"{size}, more than surface.rough.most_faces = {rough.most_faces}; points are {wide.spacing_m:g} m "
        f"apart instead of {rough.spacing_m:g} m",
        of="surface",
        option="surface.rough.most_faces",
    )
    return wide


def _faces(volume: VolumeFacets, rough: RoughParams) -> int:
    """Return about how many faces walls and roofs have: in rows along the longest side of each, up to its height."""
    shown = volume.label != FacetLabel.FLOOR
    apart_m = np.where(volume.label == FacetLabel.ROOF, rough.roof_spacing_m, rough.spacing_m)[shown, None]
    corners, double = volume.vertices[volume.faces[shown]], np.linalg.norm(volume.normals[shown], axis=1)
    sides = np.sort(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2), axis=1)
    up = double / np.maximum(sides[:, 2], 1e-12)
    least, middle, most, rows = np.maximum(1, np.rint(np.column_stack([sides, up]) / apart_m)).T
    return int((most * rows + least + middle - 2).sum())


def _wanted_m(params: SurfaceParams, fine: FineRock) -> np.ndarray:
    """Return the displacement (n,) m before bounds; points that only floors touch have 0."""
    relief, rough = _relief(params), params.rough
    wanted = np.zeros(len(fine.vertices))
    used = fine.direction.any(axis=1)
    if isinstance(relief, JointedRock):
        wanted[used] = relief_of_joints(fine.vertices[used], fine.direction[used], relief, rough.seed)
        return wanted
    modulation = Modulation(rough.modulation_m, rough.modulation_spread)
    return relief_of_noise(fine, *relief, modulation, np.random.default_rng(rough.seed))


def _relief(params: SurfaceParams) -> Relief:
    if params.rock is None:
        return choose_bands(params, measure_sources(params))
    if params.reference != "published":
        warn_user(
            f"surface.reference = {params.reference}: the rock of a volume is as configured, not fitted to it",
            option="surface.reference",
        )
    return configured_rock(params.rock)


def _report(rock: DisplacedRock) -> MeshReport:
    vertices, faces = rock.mesh.vertices, rock.mesh.faces
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
        self_intersecting=len(rock.crossings) > 0,
    )
