"""The work of stage 4 for a volume: the chunks of its visible rock, its texture, and a report on the mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from minesurveys.remarks import warn_user
from minexplore.bundle import TOPOLOGY, VOLUME
from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.params.surface import RoughParams, SurfaceParams
from pipeline.progress import progress
from pipeline.store.codecs import Bundle, decode, encode
from pipeline.surface.build import wanted_m, within_most_faces
from pipeline.surface.mesh.mesh_checks import MeshReport, report_mesh
from pipeline.surface.mesh.simplify import Simplification
from pipeline.surface.reference import measure_sources
from pipeline.surface.relief_source import Relief, bounds_of, choose_bands, configured_rock
from pipeline.types import Image
from pipeline.volume.passages.arch import Arch, arched
from pipeline.volume.world.compile import BUILT
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.record import BuiltVolume
from pipeline.volume.world.surface.chunks import cut_rock
from pipeline.volume.world.surface.displace import DisplacedRock, displace_rock
from pipeline.volume.world.surface.fine import refine
from pipeline.volume.world.surface.narrow import NO_BALLS, Balls, Narrowest, balls_along
from pipeline.volume.world.surface.room import room_about
from pipeline.volume.world.surface.scanned import NO_RGB, NO_SCAN, ScanColours, unseen
from pipeline.volume.world.topology import LegNetwork

_SIMPLIFIED = 0.5  # of a chunk's side: a tile that is simplified less, as its rock would cross, is small


@dataclass(frozen=True)
class VolumeRock:
    """The chunks of the visible rock as `NAME.msh`, its texture, and a report on its mesh, closed by the floors."""

    files: Bundle
    texture: Image
    report: MeshReport


def rock_of_volume(
    params: SurfaceParams, compiled: Path, texture: Image, scan_m: np.ndarray = NO_SCAN, scan_rgb: np.ndarray = NO_RGB
) -> VolumeRock:
    """Return the visible rock of the volume in a folder of stage 3; roofs of drawn areas have an arch.

    Near points (n, 3) m of a scan it is the volume itself, which follows them, with their colours (n, 3), if they have
    any. Away from them, and in workings that were not scanned, it is synthetic and has the texture.

    Raises
    ------
    InputError
        If the rock would need points more than 0.5 m apart to keep within `most_faces`.
    """
    with progress("surface", 4, "steps") as done:
        volume, built = decode(compiled / VOLUME, VolumeFacets), decode(compiled / BUILT, BuiltVolume)
        arch = Arch(params.roof_chamfer_m, params.rough.arch_half_span_m)
        seen = arched(volume, arch) if built.is_drawn else None
        balls = balls_along(seen or volume, decode(compiled / TOPOLOGY, LegNetwork))
        done.update()
        rock = displaced_rock(params, volume, scan_m, balls, seen)
        done.update()
        chunks, texture = cut_rock(rock, params, texture, ScanColours(scan_m, scan_rgb))
        done.update()
        files = {f"{name}.msh": encode(Path(f"{name}.msh"), mesh) for name, mesh in chunks.items()}
        return VolumeRock(files, texture, report_mesh(rock.mesh.vertices, rock.mesh.faces, len(rock.crossings) > 0))


def displaced_rock(
    params: SurfaceParams,
    volume: VolumeFacets,
    scan_m: np.ndarray = NO_SCAN,
    balls: Balls = NO_BALLS,
    seen: VolumeFacets | None = None,
) -> DisplacedRock:
    """Return the displaced rock of a volume, whose narrowest passage fits `balls`; see `rock_of_volume`.

    It is moved from the volume, or from how that is `seen` under its arch.
    """
    area_m2 = np.linalg.norm(volume.normals[volume.label != FacetLabel.FLOOR], axis=1).sum() / 2
    rough = within_most_faces(params.rough, partial(_faces, volume), f"{area_m2:.0f} m2 of walls and roofs")
    fine, walls = refine(volume, rough.spacing_m, rough.roof_spacing_m, seen), seen or volume
    simplification = Simplification(rough.kept_share, rough.tile_m * _SIMPLIFIED) if rough.kept_share else None
    wanted, share = wanted_m(rough, fine, _relief(params)), unseen(fine.vertices, scan_m)
    room = room_about(fine, walls, balls)
    free, foot_m, narrowest = closed_volume(walls).inside, params.floor_chamfer_m, Narrowest.of(balls, walls)
    rock = displace_rock(fine, wanted, room, bounds_of(rough), foot_m, simplification, free, share, narrowest)
    if len(rock.crossings):
        place, count = rock.crossings[0].round(1).tolist(), len(rock.crossings)
        warn_user(
            f"in the 32 bits of meshes facets of the volume cross or touch at {count} places, the first "
            f"{place} m; the visible rock has no relief there",
            of="surface",
        )
    return rock


def _faces(volume: VolumeFacets, rough: RoughParams) -> int:
    """Return about how many faces walls and roofs have: in rows along the longest side of each, up to its height."""
    shown = volume.label != FacetLabel.FLOOR
    apart_m = np.where(volume.label == FacetLabel.ROOF, rough.roof_spacing_m, rough.spacing_m)[shown, None]
    corners, double = volume.vertices[volume.faces[shown]], np.linalg.norm(volume.normals[shown], axis=1)
    sides = np.sort(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2), axis=1)
    up = double / np.maximum(sides[:, 2], 1e-12)
    least, middle, most, rows = np.maximum(1, np.rint(np.column_stack([sides, up]) / apart_m)).T
    return int((most * rows + least + middle - 2).sum())


def _relief(params: SurfaceParams) -> Relief:
    if params.rock is None:
        return choose_bands(params, measure_sources(params))
    if params.reference != "published":
        warn_user(
            f"surface.reference = {params.reference}: the rock of a volume is as configured, not fitted to it",
            option="surface.reference",
        )
    return configured_rock(params.rock)
