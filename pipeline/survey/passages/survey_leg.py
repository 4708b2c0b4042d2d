"""Legs of a station survey: stations in a row, with the distances to the walls."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from minesurveys.errors import InputError
from minesurveys.frames import Points2, Source

_SHAFT_M = 1e-6  # in plan


@dataclass(frozen=True)
class SurveyLeg:
    """One leg: names of its stations, positions (n, 2) m, and distances to the left and right wall (n, 2) m.

    `heights_m` (n, 3) m holds elevation and the distances up to the roof and down to the floor, nan if not measured;
    None if the survey has no elevations. A plumb leg has no length in plan, and may have no walls: these are nan.
    `grades` (n - 1,) are rise over run of the shots as stated, nan where none is; None if the survey states none.
    `sources` (n, 4) says of the distances left, right, up and down whether they were measured (`Source`), None if all
    that are no nan were; a roof that was not is at least so high. `between` (n,) is true for places that are no
    stations, None if all are. `splays_m` (k, 2, 3) has the start and the end of each splay from these stations.
    """

    name: str
    stations: list[str]
    positions_m: Points2
    walls_m: Points2
    heights_m: np.ndarray | None = None
    is_plumb: bool = False
    grades: np.ndarray | None = None
    sources: np.ndarray | None = None
    between: np.ndarray | None = None
    splays_m: np.ndarray | None = None

    @property
    def places_m(self) -> np.ndarray:
        """Return the stations' places (n, 3) m; those without elevations are at 0."""
        heights = np.zeros(len(self.stations)) if self.heights_m is None else self.heights_m[:, 0]
        return np.column_stack([self.positions_m, heights])

    @property
    def lrud_m(self) -> np.ndarray:
        """Return the distances left, right, up and down (n, 4) m, nan where none is known."""
        heights = self.walls_m * np.nan if self.heights_m is None else self.heights_m[:, 1:]
        return np.column_stack([self.walls_m, heights])

    @property
    def known(self) -> np.ndarray:
        """Return the `Source` (n, 4) of the distances left, right, up and down; ones that are nan are assumed."""
        stated = np.isfinite(self.lrud_m) * int(Source.MEASURED)
        return stated if self.sources is None else np.minimum(stated, self.sources)

    @property
    def surveyed(self) -> np.ndarray:
        """Return which places (n,) are stations of the survey."""
        return np.ones(len(self.stations), bool) if self.between is None else ~self.between


def shots_of(leg: SurveyLeg) -> list[SurveyLeg]:
    """Return a leg for each shot of a leg."""
    return [_piece(leg, np.array(ends)) for ends in pairwise(range(len(leg.stations)))]


def _piece(leg: SurveyLeg, at: np.ndarray) -> SurveyLeg:
    heights, *known = (None if rows is None else rows[at] for rows in (leg.heights_m, leg.sources, leg.between))
    names, places, walls = [leg.stations[k] for k in at], leg.positions_m[at], leg.walls_m[at]
    return SurveyLeg(leg.name, names, places, walls, heights, False, None, *known)


def cut_at_shafts(legs: list[SurveyLeg]) -> list[SurveyLeg]:
    """Return legs with their shafts, shots without a length in plan, as legs of their own at the end.

    Each end of a shaft keeps its station. Legs of one station are left out. A leg without elevations has no shafts.
    """
    pieces, shafts = [], []
    for leg in legs:
        run = np.hypot(*np.diff(leg.positions_m, axis=0).T)
        plumb = np.flatnonzero(run <= _SHAFT_M) if leg.heights_m is not None else np.zeros(0, int)
        parts = np.split(np.arange(len(leg.stations)), plumb + 1)
        pieces += [_piece(leg, part) for part in parts] if len(plumb) else [leg]
        shafts += [replace(_piece(leg, np.array([k, k + 1])), name="plumb", is_plumb=True) for k in plumb]
    return [piece for piece in pieces if len(piece.stations) > 1] + shafts


def require_connected(path: Path, legs: list[SurveyLeg]) -> None:
    """Check that all legs are connected; `InputError` names the file, the legs and where they are nearest."""
    import networkx as nx  # takes 0.2 s to load, and only readers ask

    graph: nx.Graph = nx.Graph()
    for leg in legs:
        nx.add_path(graph, leg.stations)
    components = sorted(nx.connected_components(graph), key=len, reverse=True)
    if len(components) > 1:
        separate = [leg.name for leg in legs if leg.stations[0] not in components[0]]
        first = next(leg.name for leg in legs if leg.stations[0] in components[0])
        raise InputError(
            f"{path}: legs {', '.join(separate)} share no station with leg {first}: the nearest are "
            f"{_nearest(legs, components[0])} apart; a station that two legs share has one name"
        )


def _nearest(legs: list[SurveyLeg], stations: set[str]) -> str:
    """Return the nearest two stations of which one is among some stations, with their places and their distance."""
    places = {name: place for leg in legs for name, place in zip(leg.stations, leg.positions_m, strict=True)}
    parts = [[name for name in places if (name in stations) == is_in] for is_in in (True, False)]
    ours, others = (np.array([places[name] for name in part]) for part in parts)
    far, at = cKDTree(ours).query(others)
    ends = parts[0][int(at[far.argmin()])], parts[1][int(far.argmin())]
    named = (f"{name} at ({places[name][0]:.1f}, {places[name][1]:.1f})" for name in ends)
    return f"{' and '.join(named)}, {far.min():.1f} m"
