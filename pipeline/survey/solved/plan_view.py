"""The plan view of a solved survey: legs with distances to their walls, as a flat world needs them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np

from minesurveys.errors import InputError
from minesurveys.frames import Source
from minesurveys.guard.plain_file import require_at_most
from minesurveys.limits import reader_limits
from minesurveys.remarks import warn_user
from minesurveys.solved.model import LegFlag, LegStyle, SolvedSurvey
from pipeline.survey.passages.survey_leg import SurveyLeg, cut_at_shafts
from pipeline.survey.solved.splay_hits import SplayHits
from pipeline.survey.solved.splay_walls import (
    Rows,
    agree_on_floors,
    fill_down,
    fill_sides,
    heights_of,
    measured,
    splays_by_node,
    usual_half_width_m,
)
from pipeline.survey.solved.wall_sections import with_hits

Nodes = list[int]


def plan_legs(path: Path, survey: SolvedSurvey, half_width_m: float | None = None) -> list[SurveyLeg]:
    """Return the legs of a solved survey in plan, with their heights.

    Its passages' cross-sections make the legs. All other legs of the centreline get their walls from splays
    (`walls_across`), from the passages that they continue, or as legs that nobody measured.

    Parameters
    ----------
    path : Path
    survey : SolvedSurvey
    half_width_m : float or None
        Distance to a wall where none was measured; None takes half the median width of the survey's own. A warning
        counts them.

    Raises
    ------
    InputError
        If no walls are known, or legs cross at one height without a station. The message names the file and the
        stations.

    Returns
    -------
    list of SurveyLeg
        m, in the survey's own frame.
    """
    plan = _StationPlan(survey)
    # The ends of splays are no stations of passages; a survey by laser has ten to a station.
    require_at_most(path, len(np.unique(plan.all_edges)), "stations", "stations of passages or more")
    if half_width_m is None and not survey.passages and not (survey.leg_flags & LegFlag.SPLAY).any():
        raise InputError(
            f"{path}: no cross-sections and no splays; state the distance to the walls (survey.half_width_m, "
            "--half-width)"
        )
    splays = splays_by_node(survey, plan.node)
    rows = [(plan.node[p.stations].tolist(), measured(p.lrud_m)) for p in survey.passages]
    continued = plan.between(rows)
    rows += [(nodes, np.full((len(nodes), 4), np.nan)) for nodes, _ in continued]
    hits = SplayHits([nodes for nodes, _ in rows], plan.places, splays)
    rows = [(nodes, plan.with_splays(nodes, walls, hits)) for nodes, walls in rows]
    first = len(rows) - len(continued)
    rows[first:] = [
        (nodes, np.where(np.isfinite(walls), walls, ends))
        for (nodes, walls), (_, ends) in zip(rows[first:], continued, strict=True)
    ]
    warn_of_strays(path, hits.strays)
    _warn_of_unsurveyed(path, plan)
    rows, sides = with_sides(path, rows, half_width_m, sum(map(len, splays.values())))
    rows = _with_one_floor(path, plan, rows)
    warn_of_floors(path, rows)
    rows, floors = fill_down(rows, plan.places, hits.depths())
    sources = [
        np.column_stack([known, np.full(len(nodes), Source.MEASURED), [floors[node] for node in nodes]])
        for (nodes, _), known in zip(rows, sides, strict=True)
    ]
    legs = cut_at_shafts([plan.leg_of(*row, known) for row, known in zip(rows, sources, strict=True)])
    if not legs:
        raise InputError(f"{path}: no legs with passages; widths left and right of the stations are needed")
    legs = [leg if leg.is_plumb else replace(leg, name=str(number)) for number, leg in enumerate(legs, start=1)]
    steps = {plan.names[node]: found for node, found in hits.splays.items()}
    legs = with_hits(legs, hits, plan.names)
    return [replace(leg, splays_m=_splays_of(leg, steps)) for leg in legs]


def _splays_of(leg: SurveyLeg, steps: dict[str, np.ndarray]) -> np.ndarray:
    """Return the splays (k, 2, 3) m from the stations of a leg, start and end, of steps (k, 3) m by station."""
    assert leg.heights_m is not None
    places = np.column_stack([leg.positions_m, leg.heights_m[:, 0]])
    found = [
        np.stack([np.broadcast_to(place, steps[name].shape), place + steps[name]], axis=1)
        for name, place in zip(leg.stations, places, strict=True)
        if name in steps
    ]
    return np.concatenate([np.zeros((0, 2, 3)), *found])


class _StationPlan:
    """A survey's stations without duplicates: equated stations are one node."""

    def __init__(self, survey: SolvedSurvey) -> None:
        self.survey = survey
        self.places, self.node, self.names = survey.nodes()
        self.edges = self._edges(survey.centreline())
        self.all_edges = self._edges(np.flatnonzero((survey.leg_flags | LegFlag.DUPLICATE) == LegFlag.DUPLICATE))

    def _edges(self, legs: np.ndarray) -> np.ndarray:
        """Return the nodes (k, 2) that some legs join, each pair once."""
        ends = self.node[self.survey.legs[legs]] if len(legs) else np.zeros((0, 2), np.int64)
        return np.unique(np.sort(ends[ends[:, 0] != ends[:, 1]], axis=1), axis=0)

    def leg_of(self, nodes: Nodes, walls: np.ndarray, sources: np.ndarray) -> SurveyLeg:
        """Return nodes with their distances left, right, up and down (n, 4) m as a leg.

        `sources` (n, 4) says how each distance is known.
        """
        places, names = self.places[nodes], [self.names[node] for node in nodes]
        heights = np.column_stack([places[:, 2], walls[:, 2:]])
        return SurveyLeg("", names, places[:, :2], walls[:, :2], heights, sources=sources.astype(np.uint8))

    def with_splays(self, nodes: Nodes, walls: np.ndarray, hits: SplayHits) -> np.ndarray:
        """Return the distances left, right, up and down (n, 4) m of a row of nodes, with those of splays where nan."""
        found = np.column_stack(
            [hits.sides(nodes, self._headings(nodes)), heights_of([hits.splays.get(k) for k in nodes])]
        )
        return np.where(np.isfinite(walls), walls, found)

    def between(self, passages: Rows) -> Rows:
        """Return the legs of the centreline that are in no passage, between junctions, ends and stations of passages.

        Distances are nan, but those of a passage at an end that continues it.
        """
        drawn, measured_at = set[frozenset[int]](), set[int]()
        ends = dict[int, tuple[np.ndarray, np.ndarray]]()  # of passages: the heading in plan, and the section
        for nodes, walls in passages:
            drawn.update(map(frozenset, pairwise(nodes)))
            measured_at.update(nodes)
            heading = self._headings(nodes)
            ends |= {nodes[k]: (heading[k], walls[k]) for k in (0, -1)}
        edges = [(a, b) for a, b in self.edges.tolist() if frozenset((a, b)) not in drawn]
        found = []
        for nodes in _chains(edges, measured_at):
            heading = self._headings(nodes)
            of_passages = np.full((len(nodes), 4), np.nan)
            for k in (0, -1):
                if nodes[k] in ends:
                    theirs, section = ends[nodes[k]]
                    of_passages[k] = section if theirs @ heading[k] >= 0 else section[[1, 0, 2, 3]]
            found.append((nodes, of_passages))
        return found

    def _headings(self, nodes: Nodes) -> np.ndarray:
        """Return the direction (n, 2) in plan of a row of nodes at each of them, of no stated length."""
        if len(nodes) < 2:
            return np.zeros((len(nodes), 2))
        found: np.ndarray = np.gradient(self.places[nodes][:, :2], axis=0)
        return found


def _chains(edges: list[tuple[int, int]], stops: set[int]) -> list[Nodes]:
    """Return edges between nodes as rows of nodes between junctions, ends and nodes at which rows are to stop."""
    graph: nx.Graph = nx.Graph(edges)
    left = {frozenset(edge) for edge in graph.edges}
    stops = stops | {node for node in graph if graph.degree(node) != 2}
    found = []
    for start in [*(node for node in graph if node in stops), *graph]:  # then the rings without a stop
        for follower in list(graph[start]):
            if frozenset((start, follower)) in left:
                found.append(_walk(graph, start, follower, left, stops))
    return found


def with_sides(path: Path, rows: Rows, half_width_m: float | None, splays: int = 0) -> tuple[Rows, list[np.ndarray]]:
    """Return the rows with both sides of every station, and how each side (n, 2) is known (`Source`).

    Warnings count the stations whose sides were not measured, and say of how many others, and of how many `splays`, the
    usual side comes. With splays it is the median side where no station has both.

    Raises
    ------
    InputError
        If a width is needed and neither stated nor measured anywhere, or a wall is too far from its station.
    """
    sides = np.concatenate([walls[:, :2].ravel() for _, walls in rows]) if rows else np.zeros(0)
    farthest, most = np.max(sides, where=np.isfinite(sides), initial=0.0), reader_limits().farthest_wall_m
    if farthest > most:
        raise InputError(f"{path}: a wall {farthest:g} m beside its station, at most {most:g} (farthest_wall_m)")
    usual = half_width_m or usual_half_width_m(rows, splays > 0)
    if usual is None and not np.isfinite(sides).all():
        raise InputError(
            f"{path}: no station has a distance to both walls; state it (survey.half_width_m, --half-width)"
        )
    filled = [fill_sides(walls, usual or 0.0) for _, walls in rows]
    total = sum(len(nodes) for nodes, _ in rows)
    if count := sum(one.have(Source.ASSUMED) for one in filled):
        known = np.isfinite(sides).reshape(-1, 2)
        both = int(known.all(axis=1).sum())
        found = f"half the median width of the {both} with both" if both else f"the median of {known.sum()} walls"
        found += f", in a survey of {splays} splays" * (splays > 0) + "; --half-width M states another"
        warn_user(
            f"stations of passages have no measured wall beside them; {usual:.2f} m is taken on each side "
            f"without one, {'as stated' if half_width_m else found}",
            of=path.name,
            count=f"{count} of {total}",
            option="" if half_width_m else "--half-width",
        )
    if count := sum(one.have(Source.INTERPOLATED) for one in filled):
        warn_user(
            "stations of passages lack a wall on a side that most stations of their passage have; it is "
            "interpolated between these",
            of=path.name,
            count=f"{count} of {total}",
        )
    return [(nodes, one.walls) for (nodes, _), one in zip(rows, filled, strict=True)], [one.sources for one in filled]


def _warn_of_unsurveyed(path: Path, plan: _StationPlan) -> None:
    """Warn of legs that say only that two stations are connected: they are built straight."""
    survey = plan.survey
    legs = survey.legs[(survey.leg_flags == 0) & (survey.leg_styles == LegStyle.NOSURVEY)]
    if len(legs):
        ends = plan.node[legs]
        lengths = np.linalg.norm(plan.places[ends[:, 0]] - plan.places[ends[:, 1]], axis=1)
        a, b = ends[lengths.argmax()].tolist()
        warn_user(
            "legs were not surveyed (nosurvey) and are built as straight passages, the longest "
            f"{lengths.max():.1f} m from {plan.names[a]} to {plan.names[b]}; a flag surface, duplicate or "
            "splay leaves a leg out",
            of=path.name,
            count=len(legs),
        )


def _with_one_floor(path: Path, plan: _StationPlan, rows: Rows) -> Rows:
    """Return the rows with one floor at each station, with a warning where passages state others."""
    agreed, differ = agree_on_floors(rows, plan.places)
    if differ:
        node, down, other = max(differ, key=lambda one: abs(one[1] - one[2]))
        warn_user(
            "stations have different distances down to the floor in two passages; the passage that goes "
            f"on through the station counts, and a flat one before a steep one. At {plan.names[node]} "
            f"{down:g} m are taken, not {other:g}",
            of=path.name,
            count=len(differ),
        )
    return agreed


def _walk(graph: nx.Graph, start: int, follower: int, left: set[frozenset[int]], stops: set[int]) -> Nodes:
    """Follow edges to the next stop, and take them out of `left`."""
    nodes = [start, follower]
    left.discard(frozenset((start, follower)))
    while nodes[-1] not in stops:
        following = [node for node in graph[nodes[-1]] if frozenset((nodes[-1], node)) in left]
        if not following:
            break
        left.discard(frozenset((nodes[-1], following[0])))
        nodes.append(following[0])
    return nodes


def warn_of_strays(path: Path, count: int) -> None:
    """Warn of splays that end in a passage that is not near along the survey."""
    if count:
        warn_user(
            "splays go through windows into passages that are not near along the survey; they measure no "
            "wall of their own passage",
            of=path.name,
            count=count,
        )


def warn_of_floors(path: Path, rows: Sequence[tuple[list[int], np.ndarray]]) -> None:
    """Warn of stations whose distance down is interpolated along the survey, as others have one."""
    nodes = {node for row, _ in rows for node in row}
    known = {node for row, walls in rows for node, down in zip(row, walls[:, 3], strict=True) if np.isfinite(down)}
    if known and len(known) < len(nodes):
        warn_user(
            "stations have no measured distance down to the floor; it is interpolated along the legs "
            "between those that have one, and is their median beyond them",
            of=path.name,
            count=f"{len(nodes) - len(known)} of {len(nodes)}",
        )
