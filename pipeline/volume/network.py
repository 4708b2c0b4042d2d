"""A survey as a network: stations, and legs with a cross-section at either end."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from heapq import heappop, heappush
from itertools import pairwise

import numpy as np

from minesurveys.frames import Source
from pipeline.errors import InputError
from pipeline.survey.passages.chains import Chain, continued, sections_of_chains
from pipeline.survey.passages.relief import heights_along, known_of
from pipeline.survey.passages.sections import LEAST_M, narrow_sections
from pipeline.survey.passages.survey_leg import SurveyLeg

_NO_LENGTH_M = 1e-3
NEAR_M = 5.0  # along the survey: legs so near meet, and have one floor where their sections overlap
WITHIN_M = 0.005  # of a section: the mesh has its walls within 4 mm


@dataclass(frozen=True)
class NearLegs:
    """Which of `count` shots are within a way of each other along the survey: sorted codes of their pairs."""

    codes: np.ndarray
    count: int

    def has(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Return which pairs of shots (n,) are near each other; a shot is near itself."""
        found: np.ndarray = (one == other) | np.isin(one * self.count + other, self.codes)
        return found


@dataclass(frozen=True)
class SurveyNetwork:
    """Stations and the shots between them.

    Attributes
    ----------
    places_m : (n, 3) float64, m
        From the middle of the survey.
    shots : (m, 2) int64
        Stations at the start and the end.
    across : (m, 2, 2) float64
        Horizontal unit vector to the left at either end, as of `sections_of`.
    lrud_m : (m, 2, 4) float64, m
        Distances left, right, up and down at either end.
    joined : (m, 2) bool
        Ends at which a shot shares its section with the one before or after it in its chain.
    known : (m, 2, 4) uint8
        How the distances left, right, up and down at either end are known (`Source`).
    roof_lowered : (m, 2) bool
        Ends at which nobody measured the distance up, and whose roof is lower under another floor.
    names : tuple of str
        Of the stations.
    skipped : int
        Shots without a length.
    repairs : tuple of str
        What was left out or widened, a line each, by the names of the stations.
    splays_m : (k, 2, 3) float64, m
        Start, at a station, and end of each splay.
    """

    places_m: np.ndarray
    shots: np.ndarray
    across: np.ndarray
    lrud_m: np.ndarray
    joined: np.ndarray
    known: np.ndarray
    roof_lowered: np.ndarray
    names: tuple[str, ...]
    skipped: int = 0
    repairs: tuple[str, ...] = ()
    splays_m: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3)))

    @property
    def roof_assumed(self) -> np.ndarray:
        """Return the ends (m, 2) at which nobody measured the distance up."""
        return np.asarray(self.known[:, :, 2] != Source.MEASURED)

    def leg_name(self, shot: int) -> str:
        """Return the names of a shot's stations."""
        a, b = self.shots[shot]
        return f"{self.names[a]} to {self.names[b]}"

    @property
    def ends_m(self) -> np.ndarray:
        """Return the stations (m, 2, 3) m of each shot."""
        return self.places_m[self.shots]

    @property
    def lengths_m(self) -> np.ndarray:
        """Return the shots' lengths (m,) m."""
        return np.linalg.norm(np.diff(self.ends_m, axis=1)[:, 0], axis=1)

    @cached_property
    def floors_m(self) -> np.ndarray:
        """Return the floor (m, 2, 3) m under the stations of each shot."""
        floors = self.ends_m.copy()
        floors[:, :, 2] -= self.lrud_m[:, :, 3]
        return floors

    @cached_property
    def ways_m(self) -> np.ndarray:
        """Return the way along each shot's floor, both ends (m, 2, 3) m, at least 5 mm from the walls.

        A line that runs on a wall has a floor on one side alone.
        """
        return self.beside_m(0.0)

    def beside_m(self, aside_m: float) -> np.ndarray:
        """Return lines along each shot's floor (m, 2, 3) m, so far to the left, but 5 mm from the walls at least."""
        aside = np.clip(aside_m, WITHIN_M - self.lrud_m[:, :, 1], self.lrud_m[:, :, 0] - WITHIN_M)
        ways = self.floors_m.copy()
        ways[:, :, :2] += aside[:, :, None] * self.across
        return ways

    def foot_of(self, shot: int) -> int:
        """Return the station of a shot at which its floor is lower."""
        return int(self.shots[shot, self.floors_m[shot, :, 2].argmin()])

    @property
    def grades(self) -> np.ndarray:
        """Return rise over run (m,) of the floors; inf where a shot is plumb."""
        step = np.diff(self.floors_m, axis=1)[:, 0]
        run = np.hypot(step[:, 0], step[:, 1])
        return np.where(run > _NO_LENGTH_M, np.abs(step[:, 2]) / np.maximum(run, _NO_LENGTH_M), np.inf)

    def near_legs(self, reach_m: float) -> NearLegs:
        """Return which shots are within a way of `reach_m` of each other along the survey."""
        beside: list[list[tuple[int, float, int]]] = [[] for _ in range(len(self.places_m))]
        for shot, ((a, b), length) in enumerate(zip(self.shots.tolist(), self.lengths_m.tolist(), strict=True)):
            beside[a].append((b, length, shot))
            beside[b].append((a, length, shot))
        near = [_shots_within(beside, station, reach_m) for station in range(len(beside))]
        count = len(self.shots)
        codes = [shot * count + np.array(sorted(near[i] | near[j])) for shot, (i, j) in enumerate(self.shots.tolist())]
        return NearLegs(np.concatenate([np.zeros(0, int), *codes]).astype(int), count)


def _shots_within(beside: list[list[tuple[int, float, int]]], start: int, reach_m: float) -> set[int]:
    """Return the shots at the stations that are within a way of one; `beside` has each one's neighbours."""
    way, queue = {start: 0.0}, [(0.0, start)]
    while queue:
        far, station = heappop(queue)
        for other, length, _ in beside[station] if far <= way[station] else []:
            if far + length <= min(reach_m, way.get(other, np.inf)):
                way[other] = far + length
                heappush(queue, (far + length, other))
    return {shot for station in way for _, _, shot in beside[station]}


def network_of(legs: list[SurveyLeg], height_m: float, half_m: float) -> SurveyNetwork:
    """Return the network of the plan's legs; half widths that nobody measured are `half_m`.

    The roof's height over the floor is interpolated along a leg of which half was measured, and is `height_m` else; it
    is not under its station.

    Shots without a length are counted and left out: their stations are one place, which has the name of the first.
    Sections without an area, or turned inside out, get 5 cm. Both are listed by station.

    Raises
    ------
    InputError
        If a leg has no heights, or no leg has a length.
    """
    index: dict[str, int] = {}
    names: list[str] = []
    places: list[np.ndarray] = []
    chains: list[Chain] = []
    repairs: list[str] = []
    skipped = 0
    for leg in legs:
        if leg.heights_m is None:
            raise InputError(f"leg {leg.name}: no heights")
        at = np.column_stack([leg.positions_m, leg.heights_m[:, 0]])
        lrud = np.column_stack([leg.walls_m, leg.heights_m[:, 1:]])
        known = known_of(leg)
        roofless, least = leg.known[:, 2] < Source.MEASURED, lrud[:, 2].copy()
        lrud[roofless, 2] = np.nan
        lrud = np.where(np.isfinite(lrud), lrud, [half_m, half_m, np.nan, 0.0])
        tall = heights_along(leg, lrud[:, 2] + lrud[:, 3], height_m)
        lrud[roofless, 2] = np.fmax(np.maximum(tall - lrud[:, 3], 0.0), least)[roofless]  # over stations and splays
        repairs += narrow_sections(leg.stations, lrud)
        lrud[:, :2] += np.maximum(0.0, LEAST_M - lrud[:, :2].sum(axis=1, keepdims=True)) / 2
        lrud[:, 2] += np.maximum(0.0, LEAST_M - lrud[:, 2:].sum(axis=1))
        kept: list[int] = []
        for k, name in enumerate(leg.stations):
            if kept and np.linalg.norm(at[k] - at[kept[-1]]) < _NO_LENGTH_M:
                skipped += 1
                repairs.append(f"{leg.stations[k - 1]} to {name}: no length, left out")
                index.setdefault(name, index[leg.stations[kept[-1]]])
                continue
            kept.append(k)
            if index.setdefault(name, len(places)) == len(places):
                places.append(at[k])
                names.append(name)
        if len(kept) > 1:
            chains.append(Chain([index[leg.stations[k]] for k in kept], at[kept], lrud[kept], known[kept]))
    rows: list[tuple[tuple[int, int], np.ndarray, np.ndarray, tuple[bool, bool], np.ndarray]] = []
    chains = continued(chains)
    for chain, (across, joined) in zip(chains, sections_of_chains(chains), strict=True):
        for n, ends in enumerate(pairwise(chain.stations)):
            both = slice(n, n + 2)
            rows.append((ends, across[n], chain.lrud_m[both], (joined[n], joined[n + 1]), chain.known[both]))
    if not rows:
        raise InputError(f"no leg of {len(legs)} has a length of {_NO_LENGTH_M:g} m or more")
    shots, left, walls, shared, known = (np.array(column) for column in zip(*rows, strict=True))
    around = np.array(places)
    middle = np.round((around.min(axis=0) + around.max(axis=0)) / 2)
    none, named = np.zeros_like(shared), tuple(names)
    return SurveyNetwork(around - middle, shots, left, walls, shared, known, none, named, skipped, tuple(repairs))
