"""Views of a robot in a volume with visible rock: where robots start, and at the junction where most legs meet."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path

import mujoco
import numpy as np
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import GeomGroup, fitting_geom, is_fitting, mesh_file, surface_geom
from minexplore.pictures.shown import shown_spec
from minexplore.world import load_world
from pipeline.mjcf.render import render_preview
from pipeline.mjcf.visible import VisibleMesh, hide_but, in_sight
from pipeline.report.figures.views import View, draw_eyes
from pipeline.store.codecs import Bundle, decode
from pipeline.types import Image, Mesh
from pipeline.volume.world.record import VolumeRecord
from pipeline.volume.world.surface.show import chunk_names, is_bare_floor
from pipeline.volume.world.topology import LegNetwork

_EYE_M, _EYE_SHARE = 1.0, 0.45  # over the floor, at most so much of the height
_BACK_M, _WAYS = 6.0, 32


def draw_volume_views(folder: Path, record: VolumeRecord, legs: LegNetwork, plan: BaseGeometry) -> Image:
    """Return robot-eye views side by side (600, 900 each, 3) uint8, BGR, of the bundle in a folder.

    Only what may be in sight is compiled: the `plan` is that of all storeys, which lines of sight leave nowhere.

    Raises
    ------
    BundleError
        If the bundle is not allowed, or MuJoCo refuses it.
    """
    world = load_world(folder)
    start = record.spawn.anchor_m + np.array([0.0, 0.0, _EYE_M])
    beside, spec = _at_junction(legs), shown_spec(world)
    near = in_sight(_visible(folder, record.files), plan, [start[:2], *(eye[:2] for eye, _ in beside)])
    _show_near(spec, near)
    model, T = world.compile(spec), world.T_world_mine
    ahead = _farthest(model, (T @ [*start, 1.0])[:3])  # a volume is not turned in its world
    return draw_eyes(model, T, [(start, start + ahead), *beside])


def draw_preview(files: Bundle, record: VolumeRecord, plan: BaseGeometry, width_px: int) -> Image:
    """Return the preview picture (height, width_px, 3) uint8, BGR, of the files of a bundle that has none yet."""
    with tempfile.TemporaryDirectory(prefix="minexplore-") as folder:
        for name, data in files.items():
            path = Path(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        world = load_world(Path(folder))
        spec = shown_spec(world)
        _show_near(spec, in_sight(_visible(world.folder, files), plan, [np.array(record.spawn.anchor_m[:2])]))
        return render_preview(world.compile(spec), width_px)


def _show_near(spec: mujoco.MjSpec, near: set[str]) -> None:
    """Hide visible meshes but those of some geoms, and the bare floors."""
    hide_but(spec, near | {geom.name for geom in spec.geoms if is_bare_floor(geom.meshname)})


def _visible(folder: Path, files: Iterable[str]) -> dict[str, VisibleMesh]:
    """Return the visible rock, muck and furniture by the names of their geoms."""
    found = {}
    for name in (name for name in chunk_names(files) if not is_bare_floor(name)):
        mesh = decode(folder / mesh_file(name), Mesh)
        geom = fitting_geom(name) if is_fitting(name) else surface_geom(name)
        found[geom] = VisibleMesh(GeomGroup.ROUGH_SURFACE, mesh.vertices, mesh.faces, np.eye(3), np.zeros(3))
    return found


def _farthest(model: mujoco.MjModel, eye: np.ndarray) -> np.ndarray:
    """Return the level way (3,) along which an eye (3,) m, world frame, sees farthest."""
    data, geom = mujoco.MjData(model), np.zeros(1, np.int32)
    mujoco.mj_kinematics(model, data)
    shown = np.zeros(mujoco.mjNGROUP, np.uint8)
    shown[GeomGroup.ROUGH_SURFACE] = 1
    angle = np.linspace(0, 2 * np.pi, _WAYS, endpoint=False)
    ways = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_WAYS)])
    away = [mujoco.mj_ray(model, data, eye, way, shown, 1, -1, geom) for way in ways]  # -1: beyond a floor that falls
    found: np.ndarray = ways[int(np.argmax(away))]
    return found


def _at_junction(legs: LegNetwork) -> list[View]:
    """Return the view along the longest leg of the junction where most legs meet, 6 m before it; none without one."""
    if not legs.junctions:
        return []
    meeting = {name: [leg for leg in legs.legs if name in (leg.start, leg.end)] for name in legs.junctions}
    name = max(meeting, key=lambda station: len(meeting[station]))
    leg = max(meeting[name], key=lambda one: one.length_m)
    eyes = []
    for station, (_, _, up, down) in zip((leg.start, leg.end), leg.lrud_m, strict=True):
        over = min(_EYE_M, _EYE_SHARE * (up + down)) - down
        eyes.append(legs.stations_m[station] + np.array([0.0, 0.0, over]))
    far, near = eyes if leg.end == name else eyes[::-1]
    return [(near + min(1.0, _BACK_M / leg.length_m) * (far - near), near)]
