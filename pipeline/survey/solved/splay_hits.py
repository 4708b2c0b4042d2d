"""Where splays hit the walls of passages: sections between a survey's stations, which follow these places."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field, replace
from itertools import pairwise

import networkx as nx
import numpy as np

_STRAY = 0.5  # of the way to the own passage: a splay that ends so near another one went through a window
_SQUARE = 0.35  # along over aside, at most, where a splay measures the section of a station: within 19 deg of square
AT_STATION_M = 0.3  # along, where it does, too
_SAMPLE_M = 0.2  # along a splay, of what it passed
_ON_LINE_M = 0.05  # from the survey line
_PLUMB_M = 1e-6  # in plan


@dataclass(frozen=True)
class WallHit:
    """The end of a splay at a wall of the shot between two nodes, m: along it from the first, and to its left.

    `tilt` is rise over length of the splay, `start` the node from which it was measured, `step_m` (3,) m the way from
    there, and `end_m` (3,) m where it ends.
    """

    along_m: float
    aside_m: float
    tilt: float
    start: int
    step_m: np.ndarray
    end_m: np.ndarray


@dataclass
class ShotSplays:
    """What splays say of a shot: hits of its walls, and places in the free space, m along it, to its left, over it."""

    hits: list[WallHit] = field(default_factory=list)
    free: list[tuple[float, float, float]] = field(default_factory=list)

    def turned(self, run_m: float) -> ShotSplays:
        """Return the same seen from the other end."""
        hits = [replace(hit, along_m=run_m - hit.along_m, aside_m=-hit.aside_m) for hit in self.hits]
        return ShotSplays(hits, [(run_m - along, -aside, rise) for along, aside, rise in self.free])


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
        self.shots: dict[tuple[int, int], ShotSplays] = defaultdict(ShotSplays)
        self.at: dict[tuple[int, int], list[WallHit]] = defaultdict(list)  # by node and the other node of the shot
        self._shots = np.array([pair for row in rows for pair in pairwise(row)], int).reshape(-1, 2)
        self._start, end = np.moveaxis(places_m[self._shots], 1, 0)
        self._way = end - self._start
        graph: nx.Graph = nx.Graph()
        for (a, b), way in zip(self._shots.tolist(), self._way, strict=True):
            graph.add_edge(a, b, length=float(np.linalg.norm(way)))
        self.splays = dict[int, np.ndarray]()  # (k, 3) m by node, without those through windows
        for node in sorted(splays.keys() & set(graph)):
            reach = float(np.linalg.norm(splays[node], axis=1).max())
            ways = nx.single_source_dijkstra_path_length(graph, node, cutoff=reach, weight="length")
            far = np.full(len(places_m), np.inf)
            far[list(ways)] = list(ways.values())
            own = [step for step in splays[node] if self._enter_splay(far[self._shots].min(axis=1), node, step)]
            self.splays[node] = np.array(own).reshape(-1, 3)

    def _enter_splay(self, far_m: np.ndarray, node: int, step: np.ndarray) -> bool:
        """Enter a splay (3,) m from a node, and return whether it ends in its own passage.

        One that is steeper than 45 deg measures no wall. Shots are `far_m` (m,) m away along the survey.
        """
        length, place = float(np.linalg.norm(step)), self.places_m[node] + step
        near, others = np.flatnonzero(far_m <= length), np.flatnonzero(far_m > length)
        apart = self._apart(near, place[None])[0]
        if self._apart(others, place[None]).min(initial=np.inf) < _STRAY * apart.min():
            self.strays += 1
            return False
        if abs(step[2]) > np.hypot(step[0], step[1]) or apart.min() < _ON_LINE_M:
            return True  # it measures no wall, but a height, a station or a line
        self._enter(node, step, place, int(near[apart.argmin()]))
        share = np.append(np.arange(_SAMPLE_M, length, _SAMPLE_M), length)[:, None] / length
        passed = self.places_m[node] + share * step
        for shot, spot in zip(near[self._apart(near, passed).argmin(axis=1)].tolist(), passed, strict=True):
            self.shots[self._pair(shot)].free.append(self._beside(shot, spot))
        return True

    def _pair(self, shot: int) -> tuple[int, int]:
        a, b = self._shots[shot].tolist()
        return a, b

    def _apart(self, shots: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return how far (n, k) m places (n, 3) m are from shots (k,)."""
        start, way = self._start[shots], self._way[shots]
        square = np.maximum((way**2).sum(axis=1), 1e-12)
        share = np.clip(((places[:, None] - start) * way).sum(axis=2) / square, 0, 1)
        return np.asarray(np.linalg.norm(start + share[:, :, None] * way - places[:, None], axis=2))

    def _beside(self, shot: int, place: np.ndarray) -> tuple[float, float, float]:
        """Return how far a place (3,) m is along a shot and to its left in plan, and over it, m."""
        way, from_start = self._way[shot], place - self._start[shot]
        run = max(float(np.linalg.norm(way[:2])), _PLUMB_M)
        ahead = way[:2] / run
        along, aside = float(from_start[:2] @ ahead), float(ahead[0] * from_start[1] - ahead[1] * from_start[0])
        return along, aside, float(from_start[2] - np.clip(along / run, 0, 1) * way[2])

    def _enter(self, node: int, step: np.ndarray, place: np.ndarray, shot: int) -> None:
        """Enter a splay from a node to a place (3,) m of a shot's wall."""
        a, b = self._pair(shot)
        run = float(np.linalg.norm(self._way[shot, :2]))
        tilt = abs(float(step[2])) / float(np.linalg.norm(step))
        if run < _PLUMB_M or abs(self._way[shot, 2]) > run:
            for one, other in ((a, b), (b, a)):
                if one == node:
                    self.at[one, other].append(WallHit(0.0, 0.0, tilt, node, step, place))
            return
        along, aside, _ = self._beside(shot, place)
        hit = WallHit(along, aside, tilt, node, step, place)
        zone = min(max(AT_STATION_M, _SQUARE * abs(aside)), run / 2)
        if along <= zone:
            self.at[a, b].append(hit)
        elif along >= run - zone:
            self.at[b, a].append(hit)
        self.shots[a, b].hits.append(hit)

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

    def depths(self) -> dict[int, float]:
        """Return how far, m, below nodes splays reached about them, where they did; steep shots have no floor there."""
        found: dict[int, float] = {}
        for (a, b), splays in self.shots.items():
            way = self.places_m[b] - self.places_m[a]
            run = float(np.hypot(*way[:2]))
            for along, _, rise in splays.free if abs(way[2]) <= run else ():
                for node, far in ((a, along), (b, run - along)):
                    if far <= AT_STATION_M and rise < 0:
                        found[node] = max(found.get(node, 0.0), -rise)
        return found
