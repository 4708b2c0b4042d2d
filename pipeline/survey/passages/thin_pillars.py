"""Leave out passages that lie too little over others which they do not meet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise, product
from pathlib import Path

import networkx as nx
import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import SLAB_M
from pipeline.guard.reading_process import warn_user
from pipeline.survey.passages.legs import SurveyLeg, without_shots
from pipeline.survey.passages.sheet_cells import shot_numbers, survey_cells

_OVERLAP_M2 = 0.01
_ONE_FLOOR_M = 0.3  # floors that overlap in plan and differ by less are one
_AT_JUNCTION_M, _JUNCTION_RISE_M = 12.0, 0.5  # along the legs; the arms of a junction overlap near it
_NAMED = 3  # shots that a message names
# Columns of a place (5,) after x and y: floor, roof over it, and the share of the drifts' height to add (`roof_of`), m.
_Z, _ROOF, _SHARE = 2, 3, 4


Shot = tuple[int, int]  # number of the leg, and of the station in it at which the shot begins


@dataclass(frozen=True)
class _Clash:
    """Two shots that overlap in plan at a place, m, and the difference of their floors, m."""

    shots: tuple[Shot, Shot]
    place_m: tuple[float, float]
    apart_m: float


@dataclass(frozen=True)
class _FloorPiece:
    """A piece of a leg's floor: its outline in plan, places (2, 5) at its ends, its shot, and a station beside it."""

    outline: BaseGeometry
    ends: np.ndarray
    shot: Shot
    node: str


@dataclass(frozen=True)
class _Overlaps:
    """The graph of the legs' stations, keyed by shot, and the shots that overlap too near to each other."""

    graph: nx.MultiGraph
    clashes: list[_Clash]


def without_thin_pillars(
    path: Path, legs: list[SurveyLeg], apart_m: float, station: str | None = None
) -> list[SurveyLeg]:
    """Return the legs without shots that pass over others by less than a height and do not meet them; warn of these.

    Of two such shots the one is left out without which more of the survey stays connected; of equals the shorter.

    Parameters
    ----------
    path : Path
    legs : list of SurveyLeg
        With heights, and gentle.
    apart_m : float
        Least difference of floors over each other: the height of the drifts and 0.5 m of rock. Where the survey knows
        the lower one's roof, it is the height of that and 0.5 m.
    station : str or None
        Of the piece that is built; None builds the longest.
    """
    found = _find_clashes(legs, apart_m)
    graph = found.graph
    gone: dict[Shot, _Clash] = {}
    while active := _in_piece(graph, found.clashes, station):
        clash = active[0]
        left_out = min(clash.shots, key=lambda shot: (-_left_m(graph, shot, station), _length_m(legs, shot)))
        gone[left_out] = clash
        graph.remove_edges_from([(a, b, key) for a, b, key in graph.edges(keys=True) if key == left_out])
    if gone:
        longest = sorted(gone, key=lambda shot: -_length_m(legs, shot))[:_NAMED]
        named = [
            f"{legs[k].stations[i]} to {legs[k].stations[i + 1]} ({gone[k, i].apart_m:.2f} m from another at "
            f"({gone[k, i].place_m[0]:.1f}, {gone[k, i].place_m[1]:.1f}))"
            for k, i in longest
        ]
        warn_user(
            f"{path.name}: {len(gone)} shots, {sum(_length_m(legs, shot) for shot in gone):.0f} m, lie less than "
            f"{apart_m:g} m over or under others that they do not meet, or too near to the roof of one, and are left "
            f"out, the longest {', '.join(named)}; the least height between floors where no roof is "
            "surveyed, null keeps all"
        )
    return [part for k, leg in enumerate(legs) for part in without_shots(leg, {i for j, i in gone if j == k})]


def _find_clashes(legs: list[SurveyLeg], apart_m: float) -> _Overlaps:
    """Return the graph of the legs' pieces, keyed by shot, and the shots that overlap too near to each other."""
    graph, pieces = _cut_into_pieces(legs)
    overlaps = _overlaps_of(pieces, apart_m)
    near: dict[str, dict[str, float]] = {}

    def is_at_junction(i: int, j: int) -> bool:
        start = pieces[i].node
        if start not in near:
            near[start] = nx.single_source_dijkstra_path_length(graph, start, _AT_JUNCTION_M, weight="length")
        return pieces[j].node in near[start]

    one_floor = {pair for pair, clash in overlaps.items() if clash.apart_m <= _JUNCTION_RISE_M}
    clashes = [
        clash
        for pair, clash in overlaps.items()
        if clash.apart_m > _ONE_FLOOR_M and not _opens_from(pair, one_floor, is_at_junction)
    ]
    return _Overlaps(graph, clashes)


def _cut_into_pieces(legs: list[SurveyLeg]) -> tuple[nx.MultiGraph, list[_FloorPiece]]:
    """Return the graph of the legs' stations, keyed by shot, and the pieces of floor between places of the legs."""
    _, cells, ways = survey_cells(legs)
    graph: nx.MultiGraph = nx.MultiGraph()
    pieces = []
    for number, (way, leg) in enumerate(zip(ways, legs, strict=True)):
        shot = [(number, i) for i in shot_numbers(way, leg)]
        for i in range(0, len(way) - 2, 2):
            graph.add_edge(way[i][0], way[i + 2][0], key=shot[i], length=cells[way[i][0]][way[i + 2][0]]["length"])
        for i, ((a, p, *own), (b, q, *other)) in enumerate(pairwise(way)):
            outline = shapely.convex_hull(shapely.multipoints([*own, *other]))
            if i in (0, len(way) - 2):  # a leg ends in a disc
                end, walls = (p, own) if i == 0 else (q, other)
                radius = np.linalg.norm(np.array(walls) - end[:2], axis=1).min()
                outline = outline.union(shapely.Point(end[:2]).buffer(radius, quad_segs=4))
            pieces.append(_FloorPiece(outline, np.array([p, q]), shot[i], a or b))
    return graph, pieces


def _overlaps_of(pieces: list[_FloorPiece], apart_m: float) -> dict[tuple[int, int], _Clash]:
    """Return the pairs of pieces that overlap in plan and have less than a height between their floors."""
    ends = np.array([piece.ends for piece in pieces])
    least_m = _least_height_m(ends, apart_m)
    found = {}
    for i, j in _overlapping(np.array([piece.outline for piece in pieces]), ends[:, :, _Z], least_m.max()).tolist():
        at = pieces[i].outline.intersection(pieces[j].outline).representative_point()
        places = [_place_on(pieces[k].ends, at.x, at.y) for k in (i, j)]
        lower = min(places, key=lambda place: float(place[_Z]))
        between_m = abs(float(places[0][_Z] - places[1][_Z]))
        if between_m < _least_height_m(lower, apart_m):
            found[i, j] = _Clash((pieces[i].shot, pieces[j].shot), (at.x, at.y), between_m)
    return found


def _least_height_m(places: np.ndarray, apart_m: float) -> np.ndarray:
    """Return the least height, m, of a floor over places (..., 5): over a surveyed roof, or else `apart_m`."""
    return places[..., _ROOF] + places[..., _SHARE] * (apart_m - 2 * SLAB_M) + 2 * SLAB_M


def _opens_from(
    pair: tuple[int, int], one_floor: set[tuple[int, int]], is_at_junction: Callable[[int, int], bool]
) -> bool:
    """Return whether two pieces are one open space with their legs' junction: the pieces between overlap all the way.

    Legs that part at a small angle do so farther from their junction than `_AT_JUNCTION_M`.
    """
    todo, seen = [pair], {pair}
    while todo:
        i, j = todo.pop()
        if (i, j) not in one_floor:
            continue
        if is_at_junction(i, j):
            return True
        beside = {(i + di, j + dj) for di, dj in product((-1, 0, 1), repeat=2)} - seen
        seen |= beside
        todo += beside
    return False


def _overlapping(shapes: np.ndarray, ends_m: np.ndarray, apart_m: float) -> np.ndarray:
    """Return the pairs (k, 2) of shapes that overlap in plan and whose floors, each of two heights, may be near."""
    pairs = shapely.STRtree(shapes).query(shapes, predicate="intersects").T
    low, high = ends_m.min(axis=1)[pairs], ends_m.max(axis=1)[pairs]
    pairs = pairs[(pairs[:, 0] < pairs[:, 1]) & (low.max(axis=1) - high.min(axis=1) < apart_m)]
    return pairs[shapely.area(shapely.intersection(*shapes[pairs.T])) >= _OVERLAP_M2]


def _place_on(line: np.ndarray, x: float, y: float) -> np.ndarray:
    """Return the place (5,) on a line (2, 5) of floor and roof that is nearest to a place in plan."""
    p, q = line
    step = q[:2] - p[:2]
    share = float(np.clip(np.dot((x, y) - p[:2], step) / max(float(np.dot(step, step)), 1e-12), 0.0, 1.0))
    return np.asarray(p + share * (q - p))


def _in_piece(graph: nx.MultiGraph, clashes: list[_Clash], station: str | None) -> list[_Clash]:
    """Return the clashes of which both shots are in the piece that is built."""
    kept = {key for _, _, key in graph.subgraph(_piece(graph, station)).edges(keys=True)}
    return [clash for clash in clashes if kept.issuperset(clash.shots)]


def _left_m(graph: nx.MultiGraph, shot: Shot, station: str | None) -> float:
    """Return the length, m, of the piece that is built without a shot."""
    rest = graph.edge_subgraph([(a, b, key) for a, b, key in graph.edges(keys=True) if key != shot])  # type: ignore[misc]
    return float(rest.subgraph(_piece(rest, station)).size(weight="length"))


def _piece(graph: nx.MultiGraph, station: str | None) -> set[str]:
    """Return the nodes of the longest connected piece, or of a station's."""
    if station is not None:
        return nx.node_connected_component(graph, station) if station in graph else set()
    pieces = nx.connected_components(graph)
    return max(pieces, key=lambda nodes: graph.subgraph(nodes).size(weight="length"), default=set())


def _length_m(legs: list[SurveyLeg], shot: Shot) -> float:
    number, i = shot
    return float(np.linalg.norm(legs[number].positions_m[i + 1] - legs[number].positions_m[i]))
