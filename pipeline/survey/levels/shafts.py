"""Shafts between the levels of a drawing, and raises over them: its lines that are too steep to drive."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
from shapely import Polygon

from pipeline.guard.reading_process import warn_user
from pipeline.params.floor_rules import floor_rules
from pipeline.survey.levels.areas import Area, nearest_heights
from pipeline.survey.levels.leaning import follow
from pipeline.survey.levels.walls import Wall
from pipeline.types import Shaft

_BESIDE_M = 1.5  # workings so near to a shaft's middle in plan are in its way
_USUAL_ROOF_M = 3.5  # over the floor where none is surveyed: the default of `compile3d.height_m`
_LEAN = 0.36  # run over fall: a shaft that leans by at most 20 deg off plumb is built as a plumb one
_LEAST_FALL_M = 1.0
_FLOORS_APART_M = 6.0  # a shaft that ends blind so near over other workings would break into them
_OVER_RAISE_M = 1.0  # from a raise's cap to a floor over it: two slabs and half a metre of rock
_MOST_LISTED = 5  # of the shafts that are left out
_STEP_M = 0.25  # of the places along an axis where floors are looked for


@dataclass(frozen=True)
class LevelSheets:
    """The sheets of levels: outlines and areas, m, mine frame; how far (k, 2) m each is moved aside; the datum, m."""

    polygons: list[Polygon]
    areas: list[list[Area]]
    offsets: np.ndarray
    datum_m: float

    def spans(self, place_m: np.ndarray, beside_m: float) -> np.ndarray:
        """Return the lowest floor and the highest roof (k, 2) m of each area so near to a place (2,) m."""
        round_m = place_m + beside_m * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])
        floors = [area.heights_at(round_m) for area in self._near(place_m, beside_m)]
        return np.array([(z.min(), z.max() + _USUAL_ROOF_M) for z in floors], dtype=float).reshape(-1, 2)

    def between(self, place_m: np.ndarray, low_m: float, high_m: float, beside_m: float) -> bool:
        """Return whether there is floor between two heights about a place (2,) m."""
        return any(low_m < area.heights_at(place_m[None])[0] < high_m for area in self._near(place_m, beside_m))

    def _near(self, place_m: np.ndarray, beside_m: float) -> list[Area]:
        found = self._tree.query(shapely.Point(place_m), predicate="dwithin", distance=beside_m)
        return [self._every[k] for k in found.tolist()]

    @cached_property
    def _every(self) -> list[Area]:
        return [area for areas in self.areas for area in areas]

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree([area.polygon for area in self._every])


@dataclass(frozen=True)
class _Met:
    """A place (3,) m where an axis meets the floor of a sheet, None at a blind end; `along` orders places on it."""

    along: float
    place: np.ndarray
    sheet: int | None


def shafts_of(path: Path, axes: list[Wall], sheets: LevelSheets) -> list[Shaft]:
    """Return a shaft from each floor that an axis meets to the next, or to its blind end; warns of those left out.

    Then come the raises: an axis that ends above the highest floor that it meets is one from there. An axis meets a
    floor that it crosses, one a metre over its upper end, and one so far under its lower end that this is in the drift.
    One that leans by more than 20 deg off plumb is followed from floor to floor; a line that leans and ends on no floor
    need not be a shaft, and is left out.

    Parameters
    ----------
    path : Path
    axes : list of (k, 3) m, mine frame
        From the upper to the lower end.
    sheets : LevelSheets
    """
    found: list[Shaft] = []
    raises: list[Shaft] = []
    left_out = []
    for axis in axes:
        made, reasons = _sections(axis, sheets)
        found += [shaft for shaft in made if shaft.sheet is not None]
        raises += [shaft for shaft in made if shaft.sheet is None]
        left_out += reasons
    if left_out:
        others = "".join(f"; {line}" for line in left_out[1:_MOST_LISTED])
        warn_user(f"{path.name}: {len(left_out)} shafts are left out, the first at {left_out[0]}{others}")
    return found + raises


def _sections(axis: Wall, sheets: LevelSheets) -> tuple[list[Shaft], list[str]]:
    """Return the shafts and raises along an axis, and a line for each that is left out."""
    top, bottom, step = axis[0], axis[-1], floor_rules().flat_step_m
    up, down = (np.array([0.0, 0.0, z]) for z in (max(step, _OVER_RAISE_M), -_FLOORS_APART_M))
    places = np.vstack([top + up, axis, bottom + down])
    every = _floors_met(places, sheets)
    met = [m for m in every if m.place[2] >= bottom[2] - max(step, _USUAL_ROOF_M)]
    if not met:
        return [], [f"{_from_to(top, bottom)}, whose ends are on no floor"]
    ends = [*met]
    if met[-1].place[2] - bottom[2] > step:
        if len(every) > len(met):
            return [], [f"{_from_to(top, bottom)}, which ends blind less than {_FLOORS_APART_M:g} m over another floor"]
        ends.append(_Met(len(axis), bottom, None))
    if top[2] - met[0].place[2] > _USUAL_ROOF_M:
        ends.insert(0, _Met(1.0, top, None))
    made, left_out = [], []
    for high, low in pairwise(ends):
        way = np.vstack([high.place, *(places[k] for k in range(len(places)) if high.along < k < low.along), low.place])
        shaft, reason = _shaft(way, high.sheet, low.sheet, sheets)
        if reason:
            left_out.append(f"{_from_to(high.place, low.place)}, which {reason}")
        else:
            made.append(shaft)
    return made, left_out


def _from_to(top: np.ndarray, bottom: np.ndarray) -> str:
    x, y, z = top
    return f"({x:.1f}, {y:.1f}) from {z:.1f} to {bottom[2]:.1f} m"


def _floors_met(places: np.ndarray, sheets: LevelSheets) -> list[_Met]:
    """Return where a way (k, 3) m that falls goes through floors, the highest first."""
    count = np.maximum(np.ceil(np.linalg.norm(np.diff(places, axis=0), axis=1) / _STEP_M).astype(int), 1)
    along = np.concatenate([k + np.arange(n) / n for k, n in enumerate(count.tolist())] + [[len(count)]])
    fine = np.column_stack([np.interp(along, np.arange(len(places)), places[:, k]) for k in range(3)])
    found = []
    for number, (polygon, areas) in enumerate(zip(sheets.polygons, sheets.areas, strict=True)):
        within = np.flatnonzero(shapely.contains_xy(polygon, fine[:, :2]))
        if not len(within):
            continue
        over = fine[within, 2] - nearest_heights(areas, fine[within, :2])
        for k in np.flatnonzero((over[:-1] >= 0) & (over[1:] < 0) & (np.diff(within) == 1)).tolist():
            share = over[k] / (over[k] - over[k + 1])
            at, place = (a[k] + share * (a[k + 1] - a[k]) for a in (along[within], fine[within]))
            found.append(_Met(float(at), place, number))
    return sorted(found, key=lambda m: m.along)


def _shaft(way: np.ndarray, sheet: int | None, below: int | None, sheets: LevelSheets) -> tuple[Shaft, str]:
    """Return the shaft along a way (k, 3) m from its upper end down, and why it is not built, "" if it is."""
    is_raise, top, bottom = sheet is None, way[0], way[-1]
    plan = below if sheet is None else sheet
    assert plan is not None
    x, y = (bottom if is_raise else top)[:2]
    nearest = shapely.shortest_line(shapely.Point(x, y), sheets.polygons[plan].boundary)
    dx, dy = np.diff(shapely.get_coordinates(nearest), axis=0)[0]
    place = sheets.offsets[plan] + (x, y)
    shaft = Shaft(
        stations=(f"{top[2]:.1f} m", f"{bottom[2]:.1f} m"),
        place_m=(float(place[0]), float(place[1])),
        heading_rad=float(np.arctan2(dx, -dy)),
        side_m=None,
        sheet=sheet,
        below=below,
        top_m=float(top[2] - sheets.datum_m),
        bottom_m=float(bottom[2] - sheets.datum_m),
    )
    fall, run = float(top[2] - bottom[2]), float(np.hypot(*(top - bottom)[:2]))
    if fall < _LEAST_FALL_M:
        return shaft, f"is {fall:.1f} m deep, want {_LEAST_FALL_M:g} m"
    if run > _LEAN * fall and (sheet is None or below is None):
        return shaft, f"leans, and its {'upper' if is_raise else 'lower'} end is on no floor"
    if run > _LEAN * fall:
        return follow(shaft, way[::-1] if is_raise else way, sheets.datum_m, sheets)
    if run > 0 and below == sheet:
        return shaft, f"leans by {run:.1f} m over {fall:.1f} m, and ends under the drift that it leaves"
    step = floor_rules().flat_step_m
    low, high = bottom[2] + step, top[2] + (_OVER_RAISE_M if is_raise else -step)
    if sheets.between(np.array([x, y]), low, high, _BESIDE_M):
        return shaft, "meets workings between its ends"
    return shaft, ""
