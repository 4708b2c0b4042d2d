"""Views of a robot in a volume with visible rock: where robots start, and at the junction where most legs meet."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from minexplore.pictures.shown import shown_spec
from minexplore.world import load_world
from pipeline.report.figures.views import View, draw_eyes
from pipeline.types import Image
from pipeline.volume.world.record import VolumeRecord
from pipeline.volume.world.topology import LegNetwork, heading_at

_EYE_M, _EYE_SHARE = 1.0, 0.45  # over the floor, at most so much of the height
_AHEAD_M, _BACK_M = 12.0, 6.0


def draw_volume_views(folder: Path, record: VolumeRecord, legs: LegNetwork) -> Image:
    """Return robot-eye views side by side (600, 900 each, 3) uint8, BGR, of the bundle in a folder.

    Raises
    ------
    BundleError
        If the bundle is not allowed, or MuJoCo refuses it.
    """
    world = load_world(folder)
    views = [_from_start(record, legs), *_at_junction(legs)]
    T = world.T_world_mine
    seen = [((T @ [*eye, 1.0])[:3], (T @ [*towards, 1.0])[:3]) for eye, towards in views]
    return draw_eyes(world.compile(shown_spec(world)), seen)


def _from_start(record: VolumeRecord, legs: LegNetwork) -> View:
    """Return the view along the leg on which robots start, m, mine frame."""
    heading = heading_at(legs, record.spawn.anchor_m)
    eye = record.spawn.anchor_m + np.array([0.0, 0.0, _EYE_M])
    return eye, eye + _AHEAD_M * np.array([math.cos(heading), math.sin(heading), 0.0])


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
