"""Views of a robot under the spot lights: along the longest drift, and at the junction where most drifts meet."""

from __future__ import annotations

from pathlib import Path

import cv2
import mujoco
import numpy as np
from shapely import Polygon

from minexplore.bundle import MODEL, GeomGroup
from pipeline.mjcf.bundle import OpenedBundle
from pipeline.mjcf.loading import read_spec
from pipeline.mjcf.render import render_from
from pipeline.mjcf.visible import compile_with, in_sight
from pipeline.types import DriftNetwork, Image

_EYE_M, _AHEAD_M, _BACK_M = 1.0, 12.0, 6.0
_SIZE = (900, 600)
View = tuple[np.ndarray, np.ndarray]  # an eye (3,) and the place (3,) that it looks at, m, mine frame


def draw_views(bundle: Path, world: OpenedBundle, free: Polygon, network: DriftNetwork) -> Image:
    """Return two robot-eye views side by side (600, 1800, 3) uint8, BGR, of what is in sight in a bundle."""
    longest = max(network.legs, key=lambda leg: leg.length_m)
    middle = len(longest.stations_m) // 3
    seen = [_view(longest.stations_m, middle)]
    junctions = sorted(network.junctions, key=lambda j: -sum(j in (leg.start, leg.end) for leg in network.legs))
    if junctions:
        legs = [leg for leg in network.legs if junctions[0] in (leg.start, leg.end)]
        arriving = max(legs, key=lambda leg: leg.length_m)
        stations = arriving.stations_m if arriving.end == junctions[0] else arriving.stations_m[::-1]
        seen.append(_view(stations, _back_from_end(stations)))
    shown = in_sight(world.visible, free, [eye[:2] for eye, _ in seen])
    model = compile_with(read_spec(bundle / MODEL), bundle / MODEL, shown)
    model.vis.quality.offsamples = 0  # no antialiasing
    return draw_eyes(model, np.array(world.record.T_world_mine), seen)


def draw_eyes(model: mujoco.MjModel, T_world_mine: np.ndarray, views: list[View]) -> Image:
    """Return views side by side (600, 900 each, 3) uint8, BGR."""
    placed = [((T_world_mine @ [*eye, 1.0])[:3], (T_world_mine @ [*towards, 1.0])[:3]) for eye, towards in views]
    return cv2.hconcat(render_from(model, placed, 70.0, _SIZE, (GeomGroup.FLOOR, GeomGroup.ROUGH_SURFACE)))


def _back_from_end(stations: list[tuple[float, float]]) -> int:
    far = np.linalg.norm(np.array(stations) - stations[-1], axis=1) >= _BACK_M
    return int(np.flatnonzero(far)[-1]) if far.any() else 0


def _view(stations: list[tuple[float, float]], at: int) -> View:
    """Return the view from a station to the first one 12 m ahead."""
    line = np.array(stations)
    ahead = np.flatnonzero(np.linalg.norm(line - line[at], axis=1) >= _AHEAD_M)
    target = line[ahead[ahead > at][0]] if (ahead > at).any() else line[-1]
    return np.array([*line[at], _EYE_M]), np.array([*target, _EYE_M])
