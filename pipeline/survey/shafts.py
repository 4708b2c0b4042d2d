"""Shafts of a survey in three dimensions: shots too steep to drive that lead down from a drift."""

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

    A shaft follows the lowest of the steep shots from station to station, to a built station or to its end.
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
                x, y, _ = steep.nodes[top]["place"]
                left_out.append(f"{top} to {way[-1]} at ({x:.1f}, {y:.1f}), which {reason}")
            else:
                found.append(shaft)
    if left_out:
        tell(f"{path.name}: {len(left_out)} shafts are left out, the first {left_out[0]}")
    return found


def _steep_graph(legs: list[SurveyLeg]) -> nx.Graph:
    """Return the graph of the steep shots: each station's place (3,) m on the floor, each shot's width at its ends."""
    graph: nx.Graph = nx.Graph()
    for leg in legs:
        places = np.column_stack([leg.positions_m, floor_of(leg)])
        for k in steep_shots(leg).tolist():
            for at in (k, k + 1):
                graph.add_node(leg.stations[at], place=places[at])
            widths = {leg.stations[at]: float(leg.walls_m[at].sum()) for at in (k, k + 1)}
            graph.add_edge(leg.stations[k], leg.stations[k + 1], widths=widths)
    return graph


def _lower(steep: nx.Graph, station: str) -> list[str]:
    """Return the stations below one at the other ends of its steep shots, the lowest first."""
    height = steep.nodes[station]["place"][2]
    below = [name for name in steep[station] if steep.nodes[name]["place"][2] < height]
    return sorted(below, key=lambda name: (steep.nodes[name]["place"][2], name))


def _shaft(way: list[str], steep: nx.Graph, built: Built, workings: _Workings) -> tuple[Shaft, str]:
    """Return the shaft along a way from a built station down, and why it is not built, "" if it is."""
    top, bottom = (steep.nodes[name]["place"] for name in (way[0], way[-1]))
    sheet, below = built.sheet[way[0]], built.sheet.get(way[-1])
    width, cell = steep.edges[way[0], way[1]]["widths"][way[0]], built.cells[way[0]]
    along = cell.lines[0][1] - cell.lines[0][0]
    x, y = top[:2] + built.offsets[sheet]
    shaft = Shaft(
        stations=(way[0], way[-1]),
        place_m=(float(x), float(y)),
        heading_rad=float(np.arctan2(along[1], along[0])),
        side_m=width if np.isfinite(width) and width > 0 else None,
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


class _Workings:
    """The built cells by place."""

    def __init__(self, built: Built) -> None:
        owned = [(built.cells[name], shape) for name in built.sheet for shape in built.cells[name].shapes]
        self._cells = [cell for cell, _ in owned]
        self._tree = shapely.STRtree([shape for _, shape in owned])

    def between(self, place_m: np.ndarray, low_m: float, high_m: float) -> bool:
        """Return whether there is floor between two heights about a place (2,) m."""
        x, y = place_m.tolist()
        near = self._tree.query(shapely.Point(x, y), predicate="dwithin", distance=_BESIDE_M)
        return any(low_m < self._cells[k].height_at(x, y) < high_m for k in near.tolist())
