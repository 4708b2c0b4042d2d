"""Shafts of a survey in three dimensions: shots too steep to drive that lead down from a drift, or up to no other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import networkx as nx
import numpy as np

from pipeline.guard.reading_process import warn_user
from pipeline.params.floor_rules import floor_rules
from pipeline.survey.passages.built_cells import BESIDE_M, Built, BuiltCells
from pipeline.survey.passages.leaning import WIDEST_M, find_stopes, follow, stope_length_m
from pipeline.survey.passages.legs import SurveyLeg
from pipeline.survey.passages.relief import floor_of
from pipeline.types import Shaft

LEAN = 0.36  # run over fall: a shaft that leans by at most 20 deg off plumb is built as a plumb one
LEAST_FALL_M = 1.0
FLOORS_APART_M = 6.0  # a shaft that ends blind so near over other workings would break into them
OVER_RAISE_M = 1.0  # from a raise's cap to a floor over it: two slabs and half a metre of rock
_ROUND_RAISE_M = 0.75  # a wall and half a metre of rock
MOST_LISTED = 5  # of the shafts that are left out


def steep_shots(leg: SurveyLeg) -> np.ndarray:
    """Return the numbers (k,) of the stations of a leg at which a shot steeper than `steepest_grade` begins."""
    run = np.maximum(np.linalg.norm(np.diff(leg.positions_m, axis=0), axis=1), 1e-9)
    return np.flatnonzero(np.abs(np.diff(floor_of(leg))) > floor_rules().steepest_grade * run)


def find_shafts(path: Path, legs: list[SurveyLeg], built: Built) -> list[Shaft]:
    """Return the shafts that lead down from built stations, from the first station; warns of those left out.

    A shaft follows the lowest of the steep shots from station to station, to a built station or to its end. Then come
    the raises: they follow the highest shots up from a built station to an end that is not built. Stopes stand before
    them, and their shafts again among them.
    """
    steep = _steep_graph(legs)
    if not steep:
        return []
    found, left_out, workings = [], [], BuiltCells(built)
    ways = [(way, _shaft) for way in _ways(steep, built, up=False)]
    ways += [(way, _raise) for way in _ways(steep, built, up=True) if way[-1] not in built.sheet]
    for way, make in ways:
        shaft, reason = make(way, steep, built, workings)
        if reason:
            left_out.append(_left_out(way, steep, reason))
        else:
            found.append(shaft)
    if left_out:
        others = "".join(f"; {line}" for line in left_out[1:MOST_LISTED])
        warn_user(f"{path.name}: {len(left_out)} shafts are left out, the first {left_out[0]}{others}")
    return find_stopes(found, built, workings) + [replace(shaft, long_m=None) for shaft in found]


def _ways(steep: nx.Graph, built: Built, up: bool) -> list[list[str]]:
    """Return the ways along steep shots from built stations, each to a built station or to its end."""
    ways = []
    for start in (name for name in steep if name in built.sheet):
        for first in _ahead(steep, start, up):
            way = [start, first]
            while way[-1] not in built.sheet and (ahead := _ahead(steep, way[-1], up)):
                way.append(ahead[0])
            ways.append(way)
    return ways


def _left_out(way: list[str], steep: nx.Graph, reason: str) -> str:
    x, y, _ = steep.nodes[way[0]]["place"]
    return f"{way[0]} to {way[-1]} at ({x:.1f}, {y:.1f}), which {reason}"


def _steep_graph(legs: list[SurveyLeg]) -> nx.Graph:
    """Return the graph of the steep shots: each station's place (3,) m on the floor, each shot's width at its ends.

    `elevation_m` is how high the station itself is.
    """
    graph: nx.Graph = nx.Graph()
    for leg in legs:
        assert leg.heights_m is not None
        places = np.column_stack([leg.positions_m, floor_of(leg)])
        for k in steep_shots(leg).tolist():
            for at in (k, k + 1):
                graph.add_node(leg.stations[at], place=places[at], elevation_m=float(leg.heights_m[at, 0]))
            widths = {leg.stations[at]: float(leg.walls_m[at].sum()) for at in (k, k + 1)}
            graph.add_edge(leg.stations[k], leg.stations[k + 1], widths=widths)
    return graph


def _ahead(steep: nx.Graph, station: str, up: bool) -> list[str]:
    """Return the stations above or below one at the other ends of its steep shots, the farthest first."""
    rise = {name: steep.nodes[name]["place"][2] * (1 if up else -1) for name in (station, *steep[station])}
    return sorted((name for name in steep[station] if rise[name] > rise[station]), key=lambda name: (-rise[name], name))


def _shaft(way: list[str], steep: nx.Graph, built: Built, workings: BuiltCells) -> tuple[Shaft, str]:
    """Return the shaft along a way from a built station down, and why it is not built, "" if it is."""
    top, bottom = (steep.nodes[name]["place"] for name in (way[0], way[-1]))
    sheet, below = built.sheet[way[0]], built.sheet.get(way[-1])
    shaft = Shaft(
        stations=(way[0], way[-1]),
        place_m=_place(way[0], steep, built),
        heading_rad=_heading_rad(way[0], built),
        side_m=_side_m(way, steep),
        sheet=sheet,
        below=below,
        top_m=float(top[2] - built.datum_m),
        bottom_m=float(bottom[2] - built.datum_m),
    )
    fall, run = float(top[2] - bottom[2]), float(np.hypot(*(top - bottom)[:2]))
    if fall < LEAST_FALL_M:
        return shaft, f"is {fall:.1f} m deep, want {LEAST_FALL_M:g} m"
    if run > LEAN * fall:
        return _leaning(shaft, way, steep, built, workings)
    if below == sheet:
        return shaft, f"leans by {run:.1f} m over {fall:.1f} m, and ends under the drift that it leaves"
    lowest = bottom[2] - FLOORS_APART_M if below is None else bottom[2] + floor_rules().flat_step_m
    if workings.between(top[:2], lowest, top[2] - floor_rules().flat_step_m):
        return shaft, "meets workings between its ends"
    return shaft, ""


def _raise(way: list[str], steep: nx.Graph, built: Built, workings: BuiltCells) -> tuple[Shaft, str]:
    """Return the raise along a way from a built station up, and why it is not built, "" if it is.

    It ends at the elevation of its last station.
    """
    bottom, top = steep.nodes[way[0]]["place"], _end(way, steep, up=True)
    side = _side_m(way, steep)
    shaft = Shaft(
        stations=(way[-1], way[0]),
        place_m=_place(way[0], steep, built),
        heading_rad=_heading_rad(way[0], built),
        side_m=side,
        sheet=None,
        below=built.sheet[way[0]],
        top_m=float(top[2] - built.datum_m),
        bottom_m=float(bottom[2] - built.datum_m),
    )
    rise, run = float(top[2] - bottom[2]), float(np.hypot(*(top - bottom)[:2]))
    if rise < LEAST_FALL_M:
        return shaft, f"is {rise:.1f} m high, want {LEAST_FALL_M:g} m"
    if run > LEAN * rise:
        return _leaning(shaft, way, steep, built, workings)
    beside = max(BESIDE_M, min(side or 0.0, WIDEST_M) * 2**-0.5 + _ROUND_RAISE_M)
    if workings.between(bottom[:2], bottom[2] + floor_rules().flat_step_m, top[2] + OVER_RAISE_M, beside):
        return shaft, f"meets workings between its ends, or ends less than {OVER_RAISE_M:g} m below some"
    return shaft, ""


def _leaning(shaft: Shaft, way: list[str], steep: nx.Graph, built: Built, workings: BuiltCells) -> tuple[Shaft, str]:
    """Return a shaft with the bends of its way, a stope with its length, and why it is not built, "" if it is."""
    last = _end(way, steep, up=shaft.sheet is None)
    places = np.array([*(steep.nodes[name]["place"] for name in way[:-1]), last])
    widths = steep.edges[way[0], way[1]]["widths"].values()
    stope_m = stope_length_m((places[1] - places[0])[:2], shaft.heading_rad, widths)
    if stope_m is not None:
        shaft = replace(shaft, side_m=None, long_m=stope_m)
    return follow(shaft, places, built.datum_m, workings)


def _end(way: list[str], steep: nx.Graph, up: bool) -> np.ndarray:
    """Return the place (3,) m of the last station of a way: on its floor, of a raise at its elevation."""
    last = steep.nodes[way[-1]]
    return np.array([*last["place"][:2], last["elevation_m"] if up else last["place"][2]])


def _place(station: str, steep: nx.Graph, built: Built) -> tuple[float, float]:
    """Return where a built station is in the plan of its sheet, m."""
    x, y = steep.nodes[station]["place"][:2] + built.offsets[built.sheet[station]]
    return float(x), float(y)


def _heading_rad(station: str, built: Built) -> float:
    """Return the heading of the drift at a built station."""
    start, end = built.cells[station].lines[0]
    along = end - start
    return float(np.arctan2(along[1], along[0]))


def _side_m(way: list[str], steep: nx.Graph) -> float | None:
    """Return the surveyed width of a way at its first station, m, or None."""
    width = steep.edges[way[0], way[1]]["widths"][way[0]]
    return width if np.isfinite(width) and width > 0 else None
