"""Whether workings are flat enough for a world that is built from their plan."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from minesurveys.errors import InputError
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.survey.passages.survey_leg import SurveyLeg

_BLOCK = 256
# A station may be on the floor, a wall or the roof: a smaller rise between neighbours need not be the floor's.
_STATION_M = 0.5
_WALL_M = 0.5  # where none was measured


@dataclass(frozen=True)
class _Shots:
    """All shots of all legs: names and numbers of their ends, positions (m, 2, 3) m, half widths (m,) m."""

    names: list[tuple[str, str]]
    ends: np.ndarray
    positions_m: np.ndarray
    half_m: np.ndarray


def require_flat(path: Path, legs: list[SurveyLeg], rules: FloorRules = FLOOR_RULES) -> None:
    """Refuse workings that a flat world cannot show: steep legs, and passages over each other.

    Raises
    ------
    InputError
        If a leg is steeper than `flat_grade`, or workings that overlap in plan differ by more than `flat_step_m` in
        height. The message names the stations and the place.
    """
    _require_level(path, _shots(legs), rules)
    require_single(path, legs, rules)


def _shots(legs: list[SurveyLeg]) -> _Shots:
    """Return all shots. A shot's height is the floor's where the distances down are known at both ends."""
    names, places, widths = [], [], []
    for leg in legs:
        at, down = leg.places_m, leg.lrud_m[:, 3]
        half = np.nanmax(np.column_stack([leg.walls_m, np.full(len(down), _WALL_M)]), axis=1)
        for i in range(len(leg.stations) - 1):
            ends = at[[i, i + 1]]
            if np.isfinite(down[[i, i + 1]]).all():
                ends[:, 2] -= down[[i, i + 1]]
            names.append((leg.stations[i], leg.stations[i + 1]))
            places.append(ends)
            widths.append(max(half[i], half[i + 1]))
    number = {name: i for i, name in enumerate(dict.fromkeys(name for pair in names for name in pair))}
    ends = np.array([[number[a], number[b]] for a, b in names])
    return _Shots(names, ends, np.array(places), np.array(widths))


def _require_level(path: Path, legs: _Shots, rules: FloorRules) -> None:
    step = np.diff(legs.positions_m, axis=1)[:, 0]
    run, rise = np.hypot(step[:, 0], step[:, 1]), np.abs(step[:, 2])
    most = rules.flat_grade
    steep = np.flatnonzero((rise > _STATION_M) & (rise > most * run))
    if not len(steep):
        return
    i = int(steep[np.argmax(rise[steep] / np.maximum(run[steep], 1e-9))])
    (a, b), (x, y) = legs.names[i], legs.positions_m[i, :, :2].mean(axis=0)
    how = f"a shaft of {rise[i]:.1f} m" if run[i] < 0.01 else f"{rise[i]:.1f} m up or down in {run[i]:.1f} m"
    raise InputError(
        f"{path}: {a} to {b} at ({x:.1f}, {y:.1f}): {how}; {len(steep)} of {len(legs.names)} legs are steeper than "
        f"{most:g} (survey.flat_grade), and a plan is level; survey.kind=passages builds them"
    )


def require_single(path: Path, every: list[SurveyLeg], rules: FloorRules = FLOOR_RULES) -> None:
    """Refuse passages over each other: `InputError` if workings that overlap in plan differ by over `flat_step_m`."""
    legs = _shots(every)
    lines = shapely.linestrings(legs.positions_m[:, :, :2])
    shapes = shapely.buffer(lines, legs.half_m, quad_segs=2, cap_style="flat")
    low, high = legs.positions_m[:, :, 2].min(axis=1), legs.positions_m[:, :, 2].max(axis=1)
    most, tree = rules.flat_step_m, shapely.STRtree(shapes)
    for start in range(0, len(shapes), _BLOCK):
        k, j = tree.query(shapes[start : start + _BLOCK], predicate="intersects")
        i = k + start
        apart = np.maximum(high[i], high[j]) - np.minimum(low[i], low[j]) > most
        near = (legs.ends[i][:, :, None] == legs.ends[j][:, None, :]).any(axis=(1, 2))
        for a, b in zip(*(pair[(i < j) & apart & ~near] for pair in (i, j)), strict=True):
            _require_same_height(path, legs, shapes, int(a), int(b), most)


def _require_same_height(path: Path, legs: _Shots, shapes: np.ndarray, a: int, b: int, most: float) -> None:
    common = shapely.intersection(shapes[a], shapes[b])
    if common.area < 0.01:
        return
    at = common.centroid
    heights = [_height_at(legs.positions_m[k], at.x, at.y) for k in (a, b)]
    if abs(heights[0] - heights[1]) <= most:
        return
    upper, lower = (a, b) if heights[0] > heights[1] else (b, a)
    (c, d), (e, f) = legs.names[upper], legs.names[lower]
    raise InputError(
        f"{path}: {c} to {d} passes over {e} to {f} at ({at.x:.1f}, {at.y:.1f}), {abs(heights[0] - heights[1]):.1f} m "
        f"higher, the limit is {most:g} m (survey.flat_step_m), and a plan shows one floor; survey.kind=passages "
        "builds both"
    )


def _height_at(ends: np.ndarray, x: float, y: float) -> float:
    """Return a leg's height at the place nearest to (x, y)."""
    step = ends[1] - ends[0]
    share = np.dot((x, y) - ends[0, :2], step[:2]) / max(float(np.dot(step[:2], step[:2])), 1e-12)
    return float(ends[0, 2] + np.clip(share, 0.0, 1.0) * step[2])
