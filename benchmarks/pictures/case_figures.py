"""Figures of a world that `new` made from a survey in three dimensions, against the survey itself."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np

from minexplore.floors.floor import Floor
from pipeline.geometry.openings.fit import filled_floor
from pipeline.params.floor_rules import floor_rules
from pipeline.store.codecs import decode
from pipeline.survey.formats import leg_reader
from pipeline.survey.passages.legs import SurveyLeg
from pipeline.survey.passages.relief import floor_of
from pipeline.types import DriftNetwork, Openings, Survey

_LEVEL_M = 0.5  # a floor so much above or below a station is that of another drift
_ROUND_M = 0.1  # a station may stand at a wall, whose line is simplified
_RUN_M = 0.5  # shorter shots have no grade


@dataclass(frozen=True)
class Figures:
    """A world beside the longest drivable part of its survey.

    `stations` and `length_m` are of the part, `built` how many of its stations have floor, and `left_out_m` the length
    of its shots that have none. `z_m` and `grade_deg` are the largest differences between survey and floor, of the
    heights of stations and of the grades of shots.
    """

    stations: int
    built: int
    length_m: float
    left_out_m: float
    sheets: int
    loops_surveyed: int
    loops_built: int
    pieces_built: int
    shafts: int
    roof_m: tuple[float, float]
    z_m: float
    grade_deg: float
    certificate: bool


def read_legs(source: Path, half_width_m: float | None = None) -> list[SurveyLeg]:
    """Return the legs of a survey's file."""
    legs, _ = leg_reader(source)(source, half_width_m)
    return legs


def drivable_part(legs: list[SurveyLeg]) -> nx.Graph:
    """Return the stations and gentle shots of the survey's longest connected piece.

    Stations have a `place` (3,) m on the floor in the survey's coordinates; shots have `run`, their length in plan, m.
    """
    graph: nx.Graph = nx.Graph()
    for leg in (leg for leg in legs if not leg.is_plumb):
        places = np.column_stack([leg.positions_m, floor_of(leg)])
        graph.add_nodes_from((name, {"place": place}) for name, place in zip(leg.stations, places, strict=True))
        for (a, p), (b, q) in pairwise(zip(leg.stations, places, strict=True)):
            run = float(np.hypot(*(q - p)[:2]))
            if abs(q[2] - p[2]) <= floor_rules().steepest_grade * max(run, 1e-9):
                graph.add_edge(a, b, run=run)
    pieces = nx.connected_components(graph)
    return graph.subgraph(max(pieces, key=lambda names: graph.subgraph(names).size(weight="run")))


def loops_of(graph: nx.Graph) -> int:
    """Return the number of independent loops of a connected graph."""
    return int(graph.number_of_edges() - graph.number_of_nodes() + 1)


def floor_near(floor: Floor, places_m: np.ndarray) -> np.ndarray:
    """Return the height (n,) m of the built floor nearest in height to places (n, 3) m of the mine frame, else nan."""
    found = np.full(len(places_m), np.nan)
    for sheet, offset in enumerate(floor.offset_m):
        for step in _ROUND_M * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)]):
            inside = floor.covers(places_m[:, :2] + offset + step)
            inside[inside] = floor.sheets_at(places_m[inside, :2] + offset) == sheet
            heights = np.full(len(places_m), np.nan)
            heights[inside] = floor.heights_at(places_m[inside, :2] + offset)
            off, best = np.abs(heights - places_m[:, 2]), np.abs(found - places_m[:, 2])
            nearer = (off < _LEVEL_M) & (np.isnan(best) | (off < best))
            found[nearer] = heights[nearer]
    return found


def case_figures(root: Path, source: Path, half_width_m: float | None = None) -> Figures:
    """Return the figures of a world's folder, which holds the artifacts of all stages, and its survey's file."""
    survey, openings = (
        decode(root / "survey/survey.json", Survey),
        decode(root / "compile3d/openings.json", Openings),
    )
    floor = filled_floor(decode(root / "compile3d/floor.npz", Floor), openings)  # a shaft's station is over its opening
    network: DriftNetwork = decode(root / "contours/topology.json", DriftNetwork)
    assert survey.heights is not None
    part = drivable_part(read_legs(source, half_width_m))
    origin = np.array([*survey.georeference.origin, survey.heights.datum_m])
    place = {name: part.nodes[name]["place"] - origin for name in part}
    height = dict(zip(part, floor_near(floor, np.array([place[name] for name in part])), strict=True))
    off = np.array([height[name] - place[name][2] for name in part])
    middles = floor_near(floor, np.array([(place[a] + place[b]) / 2 for a, b in part.edges]))
    grades, left_out_m = [0.0], 0.0
    for (a, b, shot), middle in zip(part.edges(data=True), middles, strict=True):
        if np.isnan([height[a], height[b], middle]).any():
            left_out_m += float(np.linalg.norm(place[b] - place[a]))
        elif shot["run"] > _RUN_M:
            rises = place[b][2] - place[a][2], height[b] - height[a]
            surveyed, made = (float(np.degrees(np.arctan2(rise, shot["run"]))) for rise in rises)
            grades.append(abs(surveyed - made))
    record = json.loads((root / "realism/world/world.json").read_text())
    roofs = record["heights"].get("roof_m", [record["height_m"]] * 2)
    return Figures(
        stations=len(part),
        built=int(np.isfinite(off).sum()),
        length_m=round(sum(float(np.linalg.norm(place[b] - place[a])) for a, b in part.edges), 1),
        left_out_m=round(left_out_m, 1),
        sheets=len(floor.offset_m),
        loops_surveyed=loops_of(part),
        loops_built=network.loops,
        pieces_built=network.components,
        shafts=len(openings.shafts),
        roof_m=(float(roofs[0]), float(roofs[1])),
        z_m=float(np.nanmax(np.abs(off))),
        grade_deg=float(max(grades)),
        certificate=json.loads((root / "validation/certificate.json").read_text())["holds"],
    )
