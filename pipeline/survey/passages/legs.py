"""Legs of a station survey, and the check of their network."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import shapely
from scipy.spatial import cKDTree

from pipeline.errors import InputError
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.types import Points2, Source, SurveyedLegs, lines_of, text_array

_BLOCK = 256
_SHAFT_M = 1e-6  # in plan


@dataclass(frozen=True)
class SurveyLeg:
    """One leg: names of its stations, positions (n, 2) m, and distances to the left and right wall (n, 2) m.

    `heights_m` (n, 3) m holds elevation and the distances up to the roof and down to the floor, nan if not measured;
    None if the survey has no elevations. A plumb leg has no length in plan, and may have no walls: these are nan.
    `grades` (n - 1,) are rise over run of the shots as stated, nan where none is; None if the survey states none.
    `sources` (n, 4) says of the distances left, right, up and down whether they were measured (`Source`), None if all
    that are no nan were; a roof that was not is at least so high. `between` (n,) is true for places that are no
    stations, None if all are. `splays_m` (k, 2, 3) has the start and the end of each splay from these stations.
    """

    name: str
    stations: list[str]
    positions_m: Points2
    walls_m: Points2
    heights_m: np.ndarray | None = None
    is_plumb: bool = False
    grades: np.ndarray | None = None
    sources: np.ndarray | None = None
    between: np.ndarray | None = None
    splays_m: np.ndarray | None = None

    @property
    def places_m(self) -> np.ndarray:
        """Return the stations' places (n, 3) m; those without elevations are at 0."""
        heights = np.zeros(len(self.stations)) if self.heights_m is None else self.heights_m[:, 0]
        return np.column_stack([self.positions_m, heights])

    @property
    def lrud_m(self) -> np.ndarray:
        """Return the distances left, right, up and down (n, 4) m, nan where none is known."""
        heights = self.walls_m * np.nan if self.heights_m is None else self.heights_m[:, 1:]
        return np.column_stack([self.walls_m, heights])

    @property
    def known(self) -> np.ndarray:
        """Return the `Source` (n, 4) of the distances left, right, up and down; ones that are nan are assumed."""
        stated = np.isfinite(self.lrud_m) * int(Source.MEASURED)
        return stated if self.sources is None else np.minimum(stated, self.sources)

    @property
    def surveyed(self) -> np.ndarray:
        """Return which places (n,) are stations of the survey."""
        return np.ones(len(self.stations), bool) if self.between is None else ~self.between


def legs_of(surveyed: SurveyedLegs) -> list[SurveyLeg]:
    """Return the legs that an artifact holds, by their numbers; each has its three coordinates."""
    names = lines_of(surveyed.names)
    legs = []
    for number, (begin, end) in enumerate(pairwise(surveyed.first.tolist())):
        places, lrud = surveyed.positions_m[begin:end], surveyed.lrud_m[begin:end]
        heights = np.column_stack([places[:, 2], lrud[:, 2:]])
        sources = surveyed.sources[begin:end] if len(surveyed.sources) else None
        between = surveyed.between[begin:end] > 0 if len(surveyed.between) else None
        rows = names[begin:end], places[:, :2], lrud[:, :2], heights, False, None, sources, between
        legs.append(SurveyLeg(str(number), *rows))
    return legs


def says_enough(distances: np.ndarray) -> bool:
    """Return whether half of the distances (n,) along a row of stations or more were measured."""
    known = np.isfinite(distances).sum()
    return bool(known and 2 * known >= len(distances))


def along_stations(distances: np.ndarray, else_m: float) -> np.ndarray:
    """Return the distances (n,) m along a row of stations without a gap.

    Measured ones stay. If half of the stations or more were measured, a distance is interpolated between them, and
    beyond the first and the last it is that of the nearest. Else it is `else_m` where it was not measured.
    """
    if not says_enough(distances):
        return np.where(np.isfinite(distances), distances, else_m)
    known = np.flatnonzero(np.isfinite(distances))
    return np.interp(np.arange(len(distances)), known, distances[known])


def pack_legs(legs: list[SurveyLeg], origin_m: tuple[float, float, float], **more: Any) -> SurveyedLegs:
    """Return legs as an artifact holds them, m, from an origin in their frame; `more` are its other fields."""
    return SurveyedLegs(
        positions_m=np.concatenate([leg.places_m for leg in legs]) - np.array(origin_m),
        lrud_m=np.concatenate([leg.lrud_m for leg in legs]),
        first=np.cumsum([0, *(len(leg.stations) for leg in legs)]).astype(np.int32),
        names=text_array([name for leg in legs for name in leg.stations]),
        **more,
    )


def shots_of(leg: SurveyLeg) -> list[SurveyLeg]:
    """Return a leg for each shot of a leg."""
    return [_piece(leg, np.array(ends)) for ends in pairwise(range(len(leg.stations)))]


def _piece(leg: SurveyLeg, at: np.ndarray) -> SurveyLeg:
    heights, *known = (None if rows is None else rows[at] for rows in (leg.heights_m, leg.sources, leg.between))
    names, places, walls = [leg.stations[k] for k in at], leg.positions_m[at], leg.walls_m[at]
    return SurveyLeg(leg.name, names, places, walls, heights, False, None, *known)


def cut_at_shafts(legs: list[SurveyLeg]) -> list[SurveyLeg]:
    """Return legs with their shafts, shots without a length in plan, as legs of their own at the end.

    Each end of a shaft keeps its station. Legs of one station are left out. A leg without elevations has no shafts.
    """
    pieces, shafts = [], []
    for leg in legs:
        run = np.hypot(*np.diff(leg.positions_m, axis=0).T)
        plumb = np.flatnonzero(run <= _SHAFT_M) if leg.heights_m is not None else np.zeros(0, int)
        parts = np.split(np.arange(len(leg.stations)), plumb + 1)
        pieces += [_piece(leg, part) for part in parts] if len(plumb) else [leg]
        shafts += [replace(_piece(leg, np.array([k, k + 1])), name="plumb", is_plumb=True) for k in plumb]
    return [piece for piece in pieces if len(piece.stations) > 1] + shafts


def require_connected(path: Path, legs: list[SurveyLeg]) -> None:
    """Check that all legs are connected; `InputError` names the file, the legs and where they are nearest."""
    graph: nx.Graph = nx.Graph()
    for leg in legs:
        nx.add_path(graph, leg.stations)
    components = sorted(nx.connected_components(graph), key=len, reverse=True)
    if len(components) > 1:
        separate = [leg.name for leg in legs if leg.stations[0] not in components[0]]
        first = next(leg.name for leg in legs if leg.stations[0] in components[0])
        raise InputError(
            f"{path}: legs {', '.join(separate)} share no station with leg {first}: the nearest are "
            f"{_nearest(legs, components[0])} apart; a station that two legs share has one name"
        )


def _nearest(legs: list[SurveyLeg], stations: set[str]) -> str:
    """Return the nearest two stations of which one is among some stations, with their places and their distance."""
    places = {name: place for leg in legs for name, place in zip(leg.stations, leg.positions_m, strict=True)}
    parts = [[name for name in places if (name in stations) == is_in] for is_in in (True, False)]
    ours, others = (np.array([places[name] for name in part]) for part in parts)
    far, at = cKDTree(ours).query(others)
    ends = parts[0][int(at[far.argmin()])], parts[1][int(far.argmin())]
    named = (f"{name} at ({places[name][0]:.1f}, {places[name][1]:.1f})" for name in ends)
    return f"{' and '.join(named)}, {far.min():.1f} m"


def require_no_crossing(path: Path, legs: list[SurveyLeg], doubt: str = "", rules: FloorRules = FLOOR_RULES) -> None:
    """Check that legs at about one height cross only at stations; `InputError` names the file, the legs and a doubt."""
    segments = [(leg, a, b) for leg in legs for a, b in pairwise(range(len(leg.stations)))]
    lines = shapely.linestrings([leg.positions_m[[a, b]] for leg, a, b in segments])
    tree = shapely.STRtree(lines)
    for start in range(0, len(lines), _BLOCK):  # the first crossing ends the search
        for k, j in tree.query(lines[start : start + _BLOCK], predicate="crosses").T:
            i = k + start
            if i >= j:
                continue
            (one, a, b), (two, c, d) = segments[i], segments[j]
            at = lines[i].intersection(lines[j]).centroid
            if _pass_over(one, a, b, two, c, d, at.x, at.y, rules):
                continue
            ends = f"{one.stations[a]} to {one.stations[b]}", f"{two.stations[c]} to {two.stations[d]}"
            who = (
                f"leg {one.name} ({ends[0]}) crosses leg {two.name} ({ends[1]})"
                if one.name != two.name
                else f"the shot {ends[0]} crosses {ends[1]}"
            )
            raise InputError(
                f"{path}: {who} at ({at.x:.2f}, {at.y:.2f}) without a station{f'; {doubt}' if doubt else ''}"
            )


def _pass_over(
    one: SurveyLeg, a: int, b: int, two: SurveyLeg, c: int, d: int, x: float, y: float, rules: FloorRules
) -> bool:
    """Return whether two legs with elevations cross at different heights."""
    if one.heights_m is None or two.heights_m is None:
        return False
    heights = []
    for leg, start, end in ((one, a, b), (two, c, d)):
        assert leg.heights_m is not None
        step = leg.positions_m[end] - leg.positions_m[start]
        share = np.dot((x, y) - leg.positions_m[start], step) / np.dot(step, step)
        heights.append(leg.heights_m[start, 0] + share * (leg.heights_m[end, 0] - leg.heights_m[start, 0]))
    return abs(heights[0] - heights[1]) > rules.flat_step_m
