"""Views of a robot in a volume with visible rock: where robots start, and at the junction where most legs meet."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from minexplore.bundle import GeomGroup
from minexplore.pictures.shown import shown_spec
from minexplore.world import load_world
from pipeline.report.figures.views import View, draw_eyes
from pipeline.types import Image
from pipeline.volume.world.record import VolumeRecord
from pipeline.volume.world.topology import LegNetwork

_EYE_M, _EYE_SHARE = 1.0, 0.45  # over the floor, at most so much of the height
_BACK_M, _WAYS = 6.0, 32


def draw_volume_views(folder: Path, record: VolumeRecord, legs: LegNetwork) -> Image:
    """Return robot-eye views side by side (600, 900 each, 3) uint8, BGR, of the bundle in a folder.

    Raises
    ------
    BundleError
        If the bundle is not allowed, or MuJoCo refuses it.
    """
    world = load_world(folder)
    model, T = world.compile(shown_spec(world)), world.T_world_mine
    start = record.spawn.anchor_m + np.array([0.0, 0.0, _EYE_M])
    ahead = _farthest(model, (T @ [*start, 1.0])[:3])  # a volume is not turned in its world
    return draw_eyes(model, T, [(start, start + ahead), *_at_junction(legs)])


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
