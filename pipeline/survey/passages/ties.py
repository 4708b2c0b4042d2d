"""Legs that were surveyed twice: they tie passages together, and are no passages of their own."""

from __future__ import annotations

from itertools import pairwise

import networkx as nx
import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minesurveys.solved.model import LegFlag, SolvedSurvey
from pipeline.survey.passages.survey_leg import SurveyLeg, shots_of
from pipeline.survey.passages.workings import build_workings


def ties_of(survey: SolvedSurvey) -> list[SurveyLeg]:
    """Return the legs that are flagged duplicate: they tie passages together, and have no walls."""
    places, node, names = survey.nodes()
    pairs = node[survey.legs[survey.leg_flags == LegFlag.DUPLICATE]].tolist()
    nobody = np.full((2, 2), np.nan)
    return [
        SurveyLeg("repeated", [names[a], names[b]], at[:, :2], nobody, np.column_stack([at[:, 2], nobody]))
        for a, b, at in ((a, b, places[[a, b]]) for a, b in pairs if a != b)
    ]


def passages_of_ties(legs: list[SurveyLeg], ties: list[SurveyLeg]) -> list[SurveyLeg]:
    """Return as passages the repeated legs without which pieces of a survey would lie apart, seen from above.

    A leg that was surveyed twice runs beside its first survey, whose walls hold its stations. Where they do not,
    nothing else leads to what hangs on it. Its stations have the walls of the legs there, or of the nearest end.
    """
    joined: nx.Graph = nx.Graph()
    for leg in legs:
        nx.add_path(joined, leg.stations)
    part = {name: number for number, names in enumerate(nx.connected_components(joined)) for name in names}
    if len(set(part.values())) < 2 or not ties:
        return []
    shapes = _shapes(legs, part)
    tied: nx.Graph = nx.Graph()
    for tie in ties:
        tied.add_edge(*tie.stations, tie=tie)
    parts: nx.Graph = nx.Graph()
    found = []
    for names in nx.connected_components(tied):
        ends = [name for name in names if name in part]
        for name in ends[1:]:
            a, b = part[ends[0]], part[name]
            parts.add_nodes_from((a, b))
            if shapes[a].intersects(shapes[b]):
                parts.add_edge(a, b)
        for name in ends[1:]:
            a, b = part[ends[0]], part[name]
            if not nx.has_path(parts, a, b):
                parts.add_edge(a, b)
                path = nx.shortest_path(tied, ends[0], name)
                found.append(_passage(legs, path, [tied.edges[pair]["tie"] for pair in pairwise(path)]))
    return found


def _shapes(legs: list[SurveyLeg], part: dict[str, int]) -> dict[int, BaseGeometry]:
    """Return the workings of each part, seen from above."""
    shots: dict[int, list[SurveyLeg]] = {number: [] for number in part.values()}
    for leg in legs:
        shots[part[leg.stations[0]]] += [leg] if leg.is_plumb else shots_of(leg)
    return {number: _workings(some) for number, some in shots.items()}


def _workings(legs: list[SurveyLeg]) -> BaseGeometry:
    driven = [leg for leg in legs if not leg.is_plumb and np.isfinite(leg.walls_m).all()]
    places = [shapely.points(leg.positions_m[0]) for leg in legs if leg.is_plumb]
    return shapely.union_all([build_workings(driven), *places])


def _passage(legs: list[SurveyLeg], names: list[str], ties: list[SurveyLeg]) -> SurveyLeg:
    """Return the leg along a row of stations."""
    places = {name: place for tie in ties for name, place in zip(tie.stations, tie.places_m, strict=True)}
    known = {}
    for leg in legs:
        for name, sides in zip(leg.stations, leg.lrud_m, strict=True):
            if name in names and np.isfinite(sides[:2]).all():
                known[name] = sides
    at = [k for k, name in enumerate(names) if name in known] or [0]
    nearest = [names[min(at, key=lambda other: abs(other - k))] for k in range(len(names))]
    lrud = np.array([known.get(name, (1.0, 1.0, np.nan, np.nan)) for name in nearest])
    line = np.array([places[name] for name in names])
    heights = np.column_stack([line[:, 2], lrud[:, 2:]])
    return SurveyLeg(f"{names[0]} to {names[-1]}", names, line[:, :2], lrud[:, :2], heights)
