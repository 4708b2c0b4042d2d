"""How walls, roofs and floors follow what was measured: splays against the rock, and what nobody measured."""

from __future__ import annotations

from typing import Any

import numpy as np

from minesurveys.frames import Source
from pipeline.geometry.ray_scene import ray_scene
from pipeline.survey.passages.legs import legs_of
from pipeline.survey.passages.relief import known_of
from pipeline.survey.passages.survey_leg import SurveyLeg
from pipeline.types import SurveyedLegs
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.union import Volume

_PARTS = {"walls": slice(0, 2), "roof": slice(2, 3), "floor": slice(3, 4)}
_NEAR_M, _FAR_M = 0.1, 0.3  # from the rock to the end of a splay; walls nearer by more are stated
_SAMPLE_M = 0.05  # along the survey line
_OUTSIDE_M = 0.1  # in rock: less is how exactly a line beside a wall is built
_ON_WALL_M = 0.005  # in rock: a station may be on a wall
_LEAST_M = 1e-6  # of a splay
_START_M = 0.02  # ahead of a station, where rays begin: it may be on the wall behind it


def wall_figures(surveyed: SurveyedLegs, volume: Volume) -> dict[str, Any]:
    """Return which share of the stations and of the length was measured, and how splays end at the built rock.

    Of the walls each side is a half. A station counts as the passage that knows it best, and half of a leg's length is
    that of either end. Without sources, as of a bundle alone, there are no shares.
    """
    found: dict[str, Any] = {}
    if len(surveyed.sources):
        found = _shares(legs_of(surveyed))
    if len(surveyed.splays_m):
        found["splay_m"] = splay_figures(splay_ends(volume, surveyed.splays_m))
    return found


def _shares(legs: list[SurveyLeg]) -> dict[str, Any]:
    stations: dict[str, np.ndarray] = {}
    widths: dict[str, float] = {}
    length = np.zeros((4, len(Source)))
    for leg in legs:
        assert leg.heights_m is not None
        known = known_of(leg)
        for name, sides, walls, is_station in zip(leg.stations, known, leg.walls_m, leg.surveyed, strict=True):
            if is_station:
                stations[name] = np.maximum(sides, stations.get(name, sides))
                if (sides[:2] == Source.MEASURED).all():
                    widths[name] = max(float(walls.sum()), widths.get(name, 0.0))
        places = np.column_stack([leg.positions_m, leg.heights_m[:, 0]])
        half = np.linalg.norm(np.diff(places, axis=0), axis=1) / 2
        weight = np.append(half, 0.0) + np.append(0.0, half)
        for side in range(4):
            length[side] += np.bincount(known[:, side], weight, len(Source))
    rows = np.array(list(stations.values()))
    found: dict[str, Any] = {}
    for source in Source:
        name = source.name.lower()
        found[f"{name}_share"] = {
            part: round(float((rows[:, some] == source).mean()), 6) for part, some in _PARTS.items()
        }
        found[f"{name}_length_share"] = {
            part: round(float(length[some, source].sum() / max(length[some].sum(), 1e-9)), 6)
            for part, some in _PARTS.items()
        }
    found["stations"] = len(rows)
    if widths:
        found["measured_width_m"] = round(float(np.median(list(widths.values()))), 3)
    return found


def splay_ends(volume: Volume, splays_m: np.ndarray) -> np.ndarray:
    """Return of splays (k, 2, 3) m, those without a length left out, what the rock makes of them (n, 5), m.

    That is the way from start to end, how far the end is from the rock, and how much nearer than the end rock is on
    the way.
    """
    step = splays_m[:, 1] - splays_m[:, 0]
    length = np.linalg.norm(step, axis=1)
    splays_m, step, length = (rows[length > _LEAST_M] for rows in (splays_m, step, length))
    off = np.abs(volume.inside.distance_m(splays_m[:, 1]))
    way = _ways_m(volume, splays_m[:, 0], step / length[:, None])
    return np.column_stack([step, off, length - way])


def splay_figures(ends: np.ndarray) -> dict[str, Any]:
    """Return how far `splay_ends` (n, 5) m are from the rock, of all and by direction, m and shares.

    Splays within 45 deg of level are `level`, steeper ones `up` or `down`. `nearer_30cm` is the share before whose ends
    rock is nearer by more than 0.3 m on the way from the station.
    """
    run, rise = np.hypot(ends[:, 0], ends[:, 1]), ends[:, 2]
    level = np.abs(rise) <= run
    kinds = {"all": level | True, "level": level, "up": ~level & (rise > 0), "down": ~level & (rise < 0)}
    return {name: _spread(ends[some, 3], ends[some, 4]) for name, some in kinds.items() if some.any()}


def _spread(off: np.ndarray, nearer: np.ndarray) -> dict[str, Any]:
    return {
        "count": len(off),
        "median": round(float(np.median(off)), 4),
        "p95": round(float(np.percentile(off, 95)), 4),
        "within_10cm": round(float((off <= _NEAR_M).mean()), 4),
        "within_30cm": round(float((off <= _FAR_M).mean()), 4),
        "nearer_30cm": round(float((nearer > _FAR_M).mean()), 4),
    }


def _ways_m(volume: Volume, starts: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """Return how far (n,) m the surface is from places (n, 3) m in directions (n, 3)."""
    middle = volume.vertices.mean(axis=0)
    scene = ray_scene(volume.vertices - middle, volume.faces, 1)
    rays = np.column_stack([starts + _START_M * ahead - middle, ahead]).astype(np.float32)
    found: np.ndarray = _START_M + scene.cast_rays(rays, nthreads=1)["t_hit"].numpy().astype(float)
    return found


def line_figures(network: SurveyNetwork, offset_m: np.ndarray, volume: Volume) -> dict[str, Any]:
    """Return how many stations lie in rock, and the length, m, of survey line that is over 10 cm in it, and where.

    The network is moved by `offset_m` (3,) m into the frame of the volume.
    """
    inside = volume.inside
    used = np.unique(network.shots)
    deep = -inside.distance_m(network.places_m[used] + offset_m)
    counts = np.maximum(1, np.round(network.lengths_m / _SAMPLE_M)).astype(int)
    shot = np.repeat(np.arange(len(counts)), counts)
    share = np.concatenate([(np.arange(count) + 0.5) / count for count in counts])[:, None]
    start, end = np.moveaxis(network.ends_m[shot] + offset_m, 1, 0)
    under = -inside.distance_m(start + share * (end - start))
    found: dict[str, Any] = {
        "stations_in_rock": int((deep > _ON_WALL_M).sum()),
        "line_in_rock_m": round(float((network.lengths_m / counts)[shot[under > _OUTSIDE_M]].sum()), 3),
    }
    if found["stations_in_rock"]:
        found["stations_in_rock_at"] = network.names[used[int(deep.argmax())]]
    if found["line_in_rock_m"]:
        found["line_in_rock_at"] = f"{under.max():.2f} m, {network.leg_name(int(shot[under.argmax()]))}"
    return found
