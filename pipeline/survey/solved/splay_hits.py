"""Where splays hit the walls of passages: sections between a survey's stations, which follow these places."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import networkx as nx
import numpy as np

from pipeline.survey.passages.legs import SurveyLeg
from pipeline.types import Source

_STRAY = 0.5  # of the way to the own passage: a splay that ends so near another one went through a window
_SQUARE = 0.35  # along over aside, at most, where a splay measures the section of a station: within 19 deg of square
_AT_STATION_M = 0.3  # along, where it does, too
_APART_M = 0.3  # between sections, at least
_INSIDE_M = 0.1  # a wall so much nearer than one that a splay passed is no wall of the passage
_NEAR_M = (
    5.0  # along the survey, between a station without a measured wall and the hits that it is interpolated between
)
_FADE_M = 2.0  # along the survey from a measured wall to an assumed one, at least
_LEVEL = 0.5  # rise over length of a splay that says what is free on its way
_PLUMB_M = 1e-6  # in plan


@dataclass(frozen=True)
class WallHit:
    """The end of a splay at a wall of the shot between two nodes, m: along it from the first, and to its left.

    `tilt` is rise over length of the splay, `start` the node from which it was measured, `end_m` (3,) m where it ends.
    """

    along_m: float
    aside_m: float
    tilt: float
    start: int
    step_m: np.ndarray
    end_m: np.ndarray


Hits = dict[tuple[int, int], list[WallHit]]


class SplayHits:
    """The hits of all splays of a survey, by shot and by station."""

    def __init__(self, rows: list[list[int]], places_m: np.ndarray, splays: dict[int, np.ndarray]) -> None:
        """Assign each splay to the nearest passage.

        Parameters
        ----------
        rows : lists of nodes
        places_m : (n, 3) m, of the nodes
        splays : arrays (k, 3) m by node
        """
        self.places_m = places_m
        self.strays = 0
        self.between: Hits = defaultdict(list)
        self.at: dict[tuple[int, int], list[WallHit]] = defaultdict(list)  # by node and the other node of the shot
        self._shots = np.array([pair for row in rows for pair in pairwise(row)], int).reshape(-1, 2)
        graph: nx.Graph = nx.Graph()
        for a, b in self._shots.tolist():
            graph.add_edge(a, b, length=float(np.linalg.norm(places_m[a] - places_m[b])))
        for node in sorted(splays.keys() & set(graph)):
            self._assign(graph, node, splays[node])

    def _assign(self, graph: nx.Graph, node: int, steps: np.ndarray) -> None:
        reach = float(np.linalg.norm(steps, axis=1).max())
        ways = nx.single_source_dijkstra_path_length(graph, node, cutoff=reach, weight="length")
        far = np.full(len(self.places_m), np.inf)
        far[list(ways)] = list(ways.values())
        start, end = np.moveaxis(self.places_m[self._shots], 1, 0)
        way = end - start
        square = np.maximum((way**2).sum(axis=1), 1e-12)
        for step in steps:
            length, place = float(np.linalg.norm(step)), self.places_m[node] + step
            if abs(step[2]) > np.hypot(step[0], step[1]):
                continue
            share = np.clip(((place - start) * way).sum(axis=1) / square, 0, 1)
            apart = np.linalg.norm(start + share[:, None] * way - place, axis=1)
            near = far[self._shots].min(axis=1) <= length
            own = np.flatnonzero(near)[apart[near].argmin()]
            if apart[~near].min(initial=np.inf) < _STRAY * apart[own]:
                self.strays += 1
                continue
            self._enter(node, step, place, tuple(self._shots[own].tolist()))

    def _enter(self, node: int, step: np.ndarray, place: np.ndarray, shot: tuple[int, int]) -> None:
        """Enter a splay from a node to a place (3,) m of a shot's wall."""
        a, b = shot
        way = (self.places_m[b] - self.places_m[a])[:2]
        run = float(np.linalg.norm(way))
        tilt = abs(float(step[2])) / float(np.linalg.norm(step))
        if run < _PLUMB_M or abs(self.places_m[b, 2] - self.places_m[a, 2]) > run:
            for one, other in ((a, b), (b, a)):
                if one == node:
                    self.at[one, other].append(WallHit(0.0, 0.0, tilt, node, step, place))
            return
        ahead = way / run
        from_start = (place - self.places_m[a])[:2]
        along, aside = float(from_start @ ahead), float(ahead[0] * from_start[1] - ahead[1] * from_start[0])
        hit = WallHit(along, aside, tilt, node, step, place)
        zone = max(_AT_STATION_M, _SQUARE * abs(aside))
        if along <= zone and along <= run / 2:
            self.at[a, b].append(hit)
        elif along >= run - zone:
            self.at[b, a].append(hit)
        else:
            self.between[shot].append(hit)

    def sides(self, nodes: list[int], heading: np.ndarray) -> np.ndarray:
        """Return the distances left and right (n, 2) m that splays measure at a row of nodes, else nan.

        `heading` (n, 2) is the direction of the passage in plan at each. Of the splays that hit a wall square to the
        passage, the one nearest to square and level counts on each side.
        """
        found = np.full((len(nodes), 2), np.nan)
        for k, node in enumerate(nodes):
            run = float(np.linalg.norm(heading[k]))
            if run < _PLUMB_M:
                continue
            left = np.array([-heading[k, 1], heading[k, 0]]) / run
            best = [np.inf, np.inf]
            for other in nodes[max(k - 1, 0) : k] + nodes[k + 1 : k + 2]:
                for hit in self.at.get((node, other), ()):
                    offset = (hit.end_m - self.places_m[node])[:2]
                    aside = float(offset @ left)
                    side = int(aside < 0)
                    off = 1 - abs(float(hit.step_m[:2] @ left)) / max(float(np.linalg.norm(hit.step_m)), 1e-9)
                    off += hit.start != node
                    if abs(aside) >= abs(float(offset @ heading[k])) / run and off < best[side]:
                        best[side] = off
                        found[k, side] = abs(aside)
        return found


def with_hits(legs: list[SurveyLeg], hits: SplayHits, names: list[str]) -> list[SurveyLeg]:
    """Return legs with sections where splays hit their walls between stations; `names` are those of the nodes."""
    by_name: dict[tuple[str, str], list[WallHit]] = {}
    for (a, b), found in hits.between.items():
        run = float(np.linalg.norm((hits.places_m[b] - hits.places_m[a])[:2]))
        by_name[names[a], names[b]] = found
        by_name[names[b], names[a]] = [
            replace(hit, along_m=run - hit.along_m, aside_m=-hit.aside_m) for hit in reversed(found)
        ]
    return [leg if leg.is_plumb else _with_hits(leg, by_name) for leg in legs]


Knot = tuple[float, float, int]  # m along a leg in plan, m to the wall, and its source


def _with_hits(leg: SurveyLeg, hits: dict[tuple[str, str], list[WallHit]]) -> SurveyLeg:
    """Return a leg with sections where splays hit its walls."""
    at = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(leg.positions_m, axis=0), axis=1)))
    walls, known = leg.walls_m.copy(), leg.known.copy()
    sides: list[list[Knot]] = [[], []]
    for k, pair in enumerate(pairwise(leg.stations)):
        found = hits.get(pair, [])
        for side in (0, 1):
            some = [(hit.along_m, abs(hit.aside_m), hit) for hit in found if (hit.aside_m < 0) == side]
            sides[side] += [(at[k] + t, w, Source.MEASURED) for t, w in _walls_of(some, at[k + 1] - at[k])]
    for side in (0, 1):
        _fill(at, walls[:, side], known[:, side], sides[side])
        stations = [(s, w, int(o)) for s, w, o in zip(at.tolist(), walls[:, side], known[:, side], strict=True)]
        sides[side] = list(_faded(sorted([*stations, *sides[side]])))
    extra = _apart(at, sides)
    if not extra:
        return replace(leg, walls_m=walls, sources=known.astype(np.uint8))
    return _refined(leg, at, extra, sides, walls, known)


def _walls_of(hits: list[tuple[float, float, WallHit]], length: float) -> Iterator[tuple[float, float]]:
    """Yield where one side's wall is along a shot, and how far aside, of hits; the most level ones first count."""
    taken: list[tuple[float, float]] = []
    for along, aside, hit in sorted(hits, key=lambda one: one[2].tilt):
        if along < _APART_M or along > length - _APART_M:
            continue
        if any(abs(along - other) < _APART_M for other, _ in taken):
            continue
        taken.append((along, aside))
        yield along, aside


def _fill(at: np.ndarray, walls: np.ndarray, known: np.ndarray, hits: list[Knot]) -> None:
    """Fill in walls (n,) of stations that are assumed, of hits near them on either side."""
    knots = sorted(
        [(s, w) for s, w, o in zip(at, walls, known, strict=True) if o == Source.MEASURED]
        + [(s, w) for s, w, _ in hits]
    )
    if not knots:
        return
    where, width = np.array(knots).T
    for k in np.flatnonzero(known == Source.ASSUMED):
        before, after = where[where <= at[k]], where[where >= at[k]]
        if len(before) and len(after) and at[k] - before[-1] <= _NEAR_M and after[0] - at[k] <= _NEAR_M:
            walls[k], known[k] = np.interp(at[k], where, width), Source.INTERPOLATED


def _faded(knots: list[Knot]) -> Iterator[Knot]:
    """Yield knots in order, with further ones where a measured wall ends on the way to an assumed one."""
    for one, two in pairwise(knots):
        yield one
        reach = max(_FADE_M, 2 * abs(one[1] - two[1]))
        if two[0] - one[0] > reach + _APART_M:
            if one[2] == Source.MEASURED and two[2] == Source.ASSUMED:
                yield one[0] + reach, two[1], Source.ASSUMED
            if two[2] == Source.MEASURED and one[2] == Source.ASSUMED:
                yield two[0] - reach, one[1], Source.ASSUMED
    yield knots[-1]


def _apart(at: np.ndarray, sides: list[list[Knot]]) -> list[float]:
    """Return where sections are between stations at some lengths (n,) along a leg, so that they are apart."""
    found: list[float] = []
    for where, _, source in sorted((knot for knots in sides for knot in knots), key=lambda knot: -knot[2]):
        if np.abs(at - where).min() > _APART_M / 2 and all(abs(where - other) > _APART_M / 4 for other in found):
            found.append(where)
    return found


def _refined(
    leg: SurveyLeg, at: np.ndarray, extra: list[float], sides: list[list[Knot]], walls: np.ndarray, known: np.ndarray
) -> SurveyLeg:
    """Return a leg with places between its stations at some lengths along it."""
    assert leg.heights_m is not None
    where = np.sort(np.concatenate([at, extra]))
    row = np.searchsorted(at, where, side="right") - 1
    is_station = np.abs(at[row] - where) < 1e-9
    first, last = row.clip(max=len(at) - 2), row.clip(max=len(at) - 2) + 1
    share = ((where - at[first]) / (at[last] - at[first]))[:, None]
    positions = leg.positions_m[first] * (1 - share) + leg.positions_m[last] * share
    heights = leg.heights_m[first] * (1 - share) + leg.heights_m[last] * share
    heights[is_station] = leg.heights_m[row[is_station]]
    sources = np.minimum(known[first], known[last])
    sources = np.where(sources == Source.MEASURED, Source.INTERPOLATED, sources)
    wide = np.zeros((len(where), 2))
    for side in (0, 1):
        s, w, o = np.array(sides[side]).T
        wide[:, side] = np.interp(where, s, w)
        measured = np.abs(s[None] - where[:, None]).min(axis=1) < 1e-3
        nearest = np.abs(s[None] - where[:, None]).argmin(axis=1)
        ends = np.minimum(
            o[np.searchsorted(s, where, side="right").clip(1) - 1], o[np.searchsorted(s, where).clip(max=len(s) - 1)]
        )
        sources[:, side] = np.where(measured, o[nearest], np.minimum(ends, Source.INTERPOLATED))
    sources[is_station, 2:] = known[row[is_station], 2:]
    names = [
        leg.stations[k] if station else f"{leg.stations[k]} to {leg.stations[k + 1]} at {s - at[k]:.2f} m"
        for k, s, station in zip(row.tolist(), where.tolist(), is_station.tolist(), strict=True)
    ]
    return replace(
        leg,
        stations=names,
        positions_m=positions,
        walls_m=wide,
        heights_m=heights,
        sources=sources.astype(np.uint8),
        between=~is_station,
    )
