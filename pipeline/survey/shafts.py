"""Shafts of a survey in three dimensions: shots too steep to drive that lead down from a drift, or up to no other."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import networkx as nx
import numpy as np
import shapely

from pipeline.params.reader_limits import reader_limits
from pipeline.survey.child import tell
from pipeline.survey.legs import SurveyLeg
from pipeline.survey.sheet_cells import Cell, floor_of
from pipeline.types import Shaft

_LEAN = 0.36  # run over fall: a shaft that leans by more than 20 deg off plumb is not built as a plumb one
_LEAST_FALL_M = 1.0
_BESIDE_M = 1.5  # workings so near to a shaft's middle in plan are in its way
FLOORS_APART_M = 6.0  # a shaft that ends blind so near over other workings would break into them
OVER_RAISE_M = 1.0  # from a raise's cap to a floor over it: two slabs and half a metre of rock
_ROUND_RAISE_M = 0.75  # a wall and half a metre of rock
_WIDEST_M = 6.0


@dataclass(frozen=True)
class Built:
    """The stations that are built: their cells, sheets, how far these are moved aside (k, 2) m, and the datum, m."""

    cells: dict[str, Cell]
    sheet: dict[str, int]
    offsets: np.ndarray
    datum_m: float


def steep_shots(leg: SurveyLeg) -> np.ndarray:
    """Return the numbers (k,) of the stations of a leg at which a shot steeper than `steepest_grade` begins."""
    run = np.maximum(np.linalg.norm(np.diff(leg.positions_m, axis=0), axis=1), 1e-9)
    return np.flatnonzero(np.abs(np.diff(floor_of(leg))) > reader_limits().steepest_grade * run)


def find_shafts(path: Path, legs: list[SurveyLeg], built: Built) -> list[Shaft]:
    """Return the shafts that lead down from built stations, from the first station; say which are left out and why.

    A shaft follows the lowest of the steep shots from station to station, to a built station or to its end. Then come
    the raises: they follow the highest shots up from a built station to an end that is not built.
    """
    steep = _steep_graph(legs)
    if not steep:
        return []
    found, left_out, workings = [], [], _Workings(built)
    for top in (name for name in steep if name in built.sheet):
        for first in _lower(steep, top):
            way = [top, first]
            while way[-1] not in built.sheet and (ahead := _lower(steep, way[-1])):
                way.append(ahead[0])
            shaft, reason = _shaft(way, steep, built, workings)
            if reason:
                left_out.append(_left_out(way, steep, reason))
            else:
                found.append(shaft)
    for bottom in (name for name in steep if name in built.sheet):
        for first in _higher(steep, bottom):
            way = [bottom, first]
            while way[-1] not in built.sheet and (ahead := _higher(steep, way[-1])):
                way.append(ahead[0])
            if way[-1] in built.sheet:  # a shaft from above
                continue
            shaft, reason = _raise(way, steep, built, workings)
            if reason:
                left_out.append(_left_out(way, steep, reason))
            else:
                found.append(shaft)
    if left_out:
        tell(f"{path.name}: {len(left_out)} shafts are left out, the first {left_out[0]}")
    return found


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


def _lower(steep: nx.Graph, station: str) -> list[str]:
    """Return the stations below one at the other ends of its steep shots, the lowest first."""
    height = steep.nodes[station]["place"][2]
    below = [name for name in steep[station] if steep.nodes[name]["place"][2] < height]
    return sorted(below, key=lambda name: (steep.nodes[name]["place"][2], name))


def _higher(steep: nx.Graph, station: str) -> list[str]:
    """Return the stations above one at the other ends of its steep shots, the highest first."""
    height = steep.nodes[station]["place"][2]
    above = [name for name in steep[station] if steep.nodes[name]["place"][2] > height]
    return sorted(above, key=lambda name: (-steep.nodes[name]["place"][2], name))


def _shaft(way: list[str], steep: nx.Graph, built: Built, workings: _Workings) -> tuple[Shaft, str]:
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
    if fall < _LEAST_FALL_M:
        return shaft, f"is {fall:.1f} m deep, want {_LEAST_FALL_M:g} m"
    if run > _LEAN * fall or below == sheet:
        return shaft, f"leans by {run:.1f} m over {fall:.1f} m, at most {_LEAN:g} of it"
    lowest = bottom[2] - FLOORS_APART_M if below is None else bottom[2] + reader_limits().flat_step_m
    if workings.between(top[:2], lowest, top[2] - reader_limits().flat_step_m):
        return shaft, "meets workings between its ends"
    return shaft, ""


def _raise(way: list[str], steep: nx.Graph, built: Built, workings: _Workings) -> tuple[Shaft, str]:
    """Return the raise along a way from a built station up, and why it is not built, "" if it is.

    It ends at the elevation of its last station.
    """
    bottom, place = steep.nodes[way[0]]["place"], steep.nodes[way[-1]]["place"]
    top = np.array([*place[:2], steep.nodes[way[-1]]["elevation_m"]])
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
    if rise < _LEAST_FALL_M:
        return shaft, f"is {rise:.1f} m high, want {_LEAST_FALL_M:g} m"
    if run > _LEAN * rise:
        return shaft, f"leans by {run:.1f} m over {rise:.1f} m, at most {_LEAN:g} of it"
    beside = max(_BESIDE_M, min(side or 0.0, _WIDEST_M) * 2**-0.5 + _ROUND_RAISE_M)
    if workings.between(bottom[:2], bottom[2] + reader_limits().flat_step_m, top[2] + OVER_RAISE_M, beside):
        return shaft, f"meets workings between its ends, or ends less than {OVER_RAISE_M:g} m below some"
    return shaft, ""


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


class _Workings:
    """The built cells by place."""

    def __init__(self, built: Built) -> None:
        owned = [(built.cells[name], shape) for name in built.sheet for shape in built.cells[name].shapes]
        self._cells = [cell for cell, _ in owned]
        self._tree = shapely.STRtree([shape for _, shape in owned])

    def between(self, place_m: np.ndarray, low_m: float, high_m: float, beside_m: float = _BESIDE_M) -> bool:
        """Return whether there is floor between two heights about a place (2,) m."""
        x, y = place_m.tolist()
        near = self._tree.query(shapely.Point(x, y), predicate="dwithin", distance=beside_m)
        return any(low_m < self._cells[k].height_at(x, y) < high_m for k in near.tolist())
