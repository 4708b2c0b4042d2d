"""The plan view of a solved survey: legs with distances to their walls, as a flat world needs them."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np

from pipeline.errors import InputError
from pipeline.guard.plain_file import require_at_most
from pipeline.guard.reading_process import warn_user
from pipeline.params.reader_limits import reader_limits
from pipeline.survey.passages.legs import Chain, ChainStation, SurveyLeg, legs_of_chains
from pipeline.survey.solved.model import LegFlag, LegStyle, SolvedSurvey
from pipeline.survey.solved.splay_walls import (
    FilledSides,
    Rows,
    agree_on_floors,
    beyond_ends,
    fill_down,
    fill_sides,
    measured,
    splays_by_node,
    usual_half_width_m,
    walls_across,
)
from pipeline.types import Known

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
    between, ends = plan.between(rows, splays)
    sections = [walls for _, walls in rows] + ends
    rows += between
    _warn_of_splays_beyond(path, plan, [nodes for nodes, _ in rows], splays)
    _warn_of_unsurveyed(path, plan)
    rows, sides = with_sides(path, rows, half_width_m, sections)
    rows = _with_one_floor(path, plan, rows)
    _warn_of_floors(path, rows)
    rows, down = fill_down(rows, plan.places)
    chains = [plan.chain_of(nodes, walls, known, down) for (nodes, walls), known in zip(rows, sides, strict=True)]
    return legs_of_chains(path, chains)


def _warn_of_splays_beyond(path: Path, plan: _StationPlan, chains: list[Nodes], splays: dict[int, np.ndarray]) -> None:
    """Warn of splays that end beyond the last station of a passage; the space that they measured is not built."""
    count, farthest, end = beyond_ends(chains, plan.places, splays)
    if end is not None:
        warn_user(
            f"{path.name}: {count} splays point beyond ends of passages, which are built to their last stations: the "
            f"farthest is {farthest:.1f} m beyond {plan.names[end]}; a leg to a station there builds that part"
        )


def node_of_stations(survey: SolvedSurvey) -> tuple[np.ndarray, np.ndarray]:
    """Return the places (k, 3) m of a survey's stations, each once, and which of them (n,) each station has."""
    places, node = np.unique(survey.positions_m, axis=0, return_inverse=True)
    return places, node.reshape(-1)


def station_names(survey: SolvedSurvey, node: np.ndarray) -> list[str]:
    """Return the name of each node: the first of its stations' names. Equated stations have one."""
    names = dict.fromkeys(range(int(node.max(initial=-1)) + 1), "")
    for number, name in zip(node.tolist(), survey.names, strict=True):
        names[number] = names[number] or name
    return [name or f"unnamed {number}" for number, name in names.items()]


class _StationPlan:
    """A survey's stations without duplicates: equated stations are one node."""

    def __init__(self, survey: SolvedSurvey) -> None:
        self.survey = survey
        self.places, self.node = node_of_stations(survey)
        self.names = station_names(survey, self.node)
        self.edges = self._edges(survey.centreline())
        self.all_edges = self._edges(np.flatnonzero((survey.leg_flags | LegFlag.DUPLICATE) == LegFlag.DUPLICATE))

    def _edges(self, legs: np.ndarray) -> np.ndarray:
        """Return the nodes (k, 2) that some legs join, each pair once."""
        ends = self.node[self.survey.legs[legs]] if len(legs) else np.zeros((0, 2), np.int64)
        return np.unique(np.sort(ends[ends[:, 0] != ends[:, 1]], axis=1), axis=0)

    def chain_of(self, nodes: Nodes, walls: np.ndarray, sides: np.ndarray, floors: dict[int, Known]) -> Chain:
        """Return nodes with their distances left, right, up and down (n, 4) m as stations of a passage.

        `sides` (n, 2) is how the first two are known, `floors` how the last is, by node.
        """
        found = []
        for node, (left, right, up, down), (port, starboard) in zip(nodes, walls.tolist(), sides.tolist(), strict=True):
            x, y, z = self.places[node].tolist()
            known = (port, starboard, Known.MEASURED, floors.get(node, Known.ASSUMED))
            found.append(ChainStation(self.names[node], (x, y), (left, right), (z, up, down), known))
        return found

    def between(self, passages: Rows, splays: dict[int, np.ndarray]) -> tuple[Rows, list[np.ndarray]]:
        """Return the legs of the centreline that are in no passage, between junctions, ends and stations of passages.

        Distances are those of splays. At an end that continues a passage, what no splay measured is the passage's. The
        second result has the passages' sections (n, 4) m of each row, nan where it continues none.
        """
        drawn, measured_at = set[frozenset[int]](), set[int]()
        ends = dict[int, tuple[np.ndarray, np.ndarray]]()  # of passages: the heading in plan, and the section
        for nodes, walls in passages:
            drawn.update(map(frozenset, pairwise(nodes)))
            measured_at.update(nodes)
            heading = self._headings(nodes)
            ends |= {nodes[k]: (heading[k], walls[k]) for k in (0, -1)}
        edges = [(a, b) for a, b in self.edges.tolist() if frozenset((a, b)) not in drawn]
        found, sections = [], []
        for nodes in _chains(edges, measured_at):
            walls = walls_across(self.places[nodes], [splays.get(node) for node in nodes])
            heading = self._headings(nodes)
            of_passages = np.full_like(walls, np.nan)
            for k in (0, -1):
                if nodes[k] in ends:
                    theirs, section = ends[nodes[k]]
                    of_passages[k] = section if theirs @ heading[k] >= 0 else section[[1, 0, 2, 3]]
            found.append((nodes, np.where(np.isfinite(walls), walls, of_passages)))
            sections.append(of_passages)
        return found, sections

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


def with_sides(
    path: Path, rows: Rows, half_width_m: float | None, sections: list[np.ndarray]
) -> tuple[Rows, list[np.ndarray]]:
    """Return the rows with both sides of every station, and how these (n, 2) are known, with warnings that count them.

    `sections` are the distances (n, 4) m of each row that are cross-sections and no splays, nan elsewhere.

    Raises
    ------
    InputError
        If a width is needed and neither stated nor measured anywhere, or a wall is too far from its station.
    """
    sides = np.concatenate([walls[:, :2].ravel() for _, walls in rows]) if rows else np.zeros(0)
    farthest, most = np.max(sides, where=np.isfinite(sides), initial=0.0), reader_limits().farthest_wall_m
    if farthest > most:
        raise InputError(f"{path}: a wall {farthest:g} m beside its station, at most {most:g} (farthest_wall_m)")
    usual = half_width_m or usual_half_width_m(rows)
    filled: list[FilledSides] = []
    for (_, walls), stated in zip(rows, sections, strict=True):
        if usual is None and not np.isfinite(walls[:, :2]).all():
            raise InputError(
                f"{path}: no station has a distance to both walls; state it (survey.half_width_m, --half-width)"
            )
        filled.append(fill_sides(walls, usual or 0.0, stated))
    total = sum(len(nodes) for nodes, _ in rows)
    if count := sum(int(sides.usual.sum()) for sides in filled):
        few = sum(int(sides.unused.sum()) for sides in filled)
        splays = f", also at {few} whose splays are the few of a long passage," if few else ""
        source = "as stated" if half_width_m else "half the median width of the others; --half-width M states another"
        warn_user(
            f"{path.name}: {count} of {total} stations of passages have no measured wall beside them; "
            f"{usual:.2f} m is taken on each side without one{splays}{'' if few else ','} {source}"
        )
    if count := sum(int(sides.interpolated.sum()) for sides in filled):
        warn_user(
            f"{path.name}: {count} of {total} stations of passages lack a wall on a side that most stations of their "
            "passage have; it is interpolated between these"
        )
    walled = [(nodes, sides.walls) for (nodes, _), sides in zip(rows, filled, strict=True)]
    return walled, [sides.known for sides in filled]


def _warn_of_floors(path: Path, rows: Rows) -> None:
    """Warn of stations whose distance down is interpolated along the survey, as others have one."""
    nodes = {node for row, _ in rows for node in row}
    known = {node for row, walls in rows for node, down in zip(row, walls[:, 3], strict=True) if np.isfinite(down)}
    if known and len(known) < len(nodes):
        warn_user(
            f"{path.name}: {len(nodes) - len(known)} of {len(nodes)} stations have no measured distance down to the "
            "floor; it is interpolated along the legs between those that have one, and is their median beyond them"
        )


def _warn_of_unsurveyed(path: Path, plan: _StationPlan) -> None:
    """Warn of legs that say only that two stations are connected: they are built straight."""
    survey = plan.survey
    legs = survey.legs[(survey.leg_flags == 0) & (survey.leg_styles == LegStyle.NOSURVEY)]
    if len(legs):
        ends = plan.node[legs]
        lengths = np.linalg.norm(plan.places[ends[:, 0]] - plan.places[ends[:, 1]], axis=1)
        a, b = ends[lengths.argmax()].tolist()
        warn_user(
            f"{path.name}: {len(legs)} legs were not surveyed (nosurvey) and are built as straight passages, the "
            f"longest {lengths.max():.1f} m from {plan.names[a]} to {plan.names[b]}; a flag surface, duplicate or "
            "splay leaves a leg out"
        )


def _with_one_floor(path: Path, plan: _StationPlan, rows: Rows) -> Rows:
    """Return the rows with one floor at each station, with a warning where passages state others."""
    agreed, differ = agree_on_floors(rows, plan.places)
    if differ:
        node, down, other = max(differ, key=lambda one: abs(one[1] - one[2]))
        warn_user(
            f"{path.name}: {len(differ)} stations have different distances down to the floor in two passages; the "
            f"passage that goes on through the station counts, and a flat one before a steep one. At "
            f"{plan.names[node]} {down:g} m are taken, not {other:g}"
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
