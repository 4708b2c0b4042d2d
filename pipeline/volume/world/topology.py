"""The network of a survey's legs in three dimensions, and where robots start in it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from minexplore.floors.volume_arrays import FloorSpans
from pipeline.errors import GeometryError
from pipeline.params.compile3d import SpawnParams, VolumeParams
from pipeline.survey.passages.legs import legs_of, names_between
from pipeline.types import SurveyedLegs, lines_of
from pipeline.volume.height_field.assumed_roofs import network_with_roofs
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.union import STEEPEST
from pipeline.volume.world.reach import RobotSize, regions_of

_AROUND_M = 2.0  # height over or under a stated start within which a floor belongs to it
_DIGITS = 4

Place = tuple[float, float, float]


@dataclass(frozen=True)
class LegRecord:
    """A leg between two stations: length m, rise over run of its floor, and left, right, up, down m at either end."""

    name: str
    start: str
    end: str
    length_m: float
    grade: float
    lrud_m: list[tuple[float, float, float, float]]

    @property
    def headroom_m(self) -> np.ndarray:
        """Return the free height (2,) m over its floor at either end."""
        return np.array(self.lrud_m)[:, 2:].sum(axis=1)


@dataclass(frozen=True)
class LegNetwork:
    """The legs of a survey in the mine frame: stations by name, m; legs by number, as `volume.npz` has them.

    The grade of a plumb leg is the largest number that JSON can hold. `dead_ends` are stations of one leg, `entrances`
    those that the survey says are open to the surface, `between` those of `stations_m` that are no stations: places of
    a section between two.

    It is the record of a `SurveyNetwork`, which is not made again from it: 117 of the 513 lengths of Wheal Pell differ
    in the fourth decimal from those between their rounded stations, and how a distance is known is not stated.
    """

    stations_m: dict[str, Place]
    legs: list[LegRecord]
    junctions: list[str]
    dead_ends: list[str]
    entrances: list[str]
    loops: int
    components: int
    total_length_m: float
    between: list[str] = field(default_factory=list)


def mine_network(surveyed: SurveyedLegs, height_m: float, params: VolumeParams) -> tuple[SurveyNetwork, np.ndarray]:
    """Return the network of a survey about its middle, and the offset (3,) m of that from the mine frame's origin.

    What nobody measured is as `network_with_roofs` says.
    """
    network = network_with_roofs(legs_of(surveyed), height_m, params.half_width_m, params.roof_m)
    offset = (surveyed.positions_m[0] - network.places_m[0]).round(_DIGITS + 2)
    return replace(network, splays_m=surveyed.splays_m - offset), offset


def require_flat_leg(network: SurveyNetwork) -> None:
    """Refuse a survey without a leg that is flat enough for a floor; `GeometryError` names the flattest.

    Every robot starts on a floor, and the foot of a shaft alone is none.
    """
    grades = network.grades
    flattest = int(grades.argmin())
    if grades[flattest] > STEEPEST:
        rise, most = (math.degrees(math.atan(grade)) for grade in (grades[flattest], STEEPEST))
        raise GeometryError(
            "no leg is flat enough for a floor, on which every robot starts, a quadrotor too: the flattest, "
            f"{network.leg_name(flattest)}, rises by {rise:.1f} deg, a floor by at most {most:.0f} deg; add the leg "
            "where robots start"
        )


def leg_network(network: SurveyNetwork, offset_m: np.ndarray, surveyed: SurveyedLegs) -> LegNetwork:
    """Return the record of a survey's network whose places are moved by `offset_m` (3,) into the mine frame."""
    used, ends, degree = np.unique(network.shots, return_inverse=True, return_counts=True)
    links = coo_array((np.ones(len(network.shots)), ends.reshape(-1, 2).T), (len(used), len(used)))
    pieces = int(connected_components(links, directed=False)[0])
    places = (network.places_m + offset_m).round(_DIGITS)
    lengths, grades = network.lengths_m, network.grades
    names = network.names
    legs = [
        LegRecord(
            str(k),
            names[a],
            names[b],
            round(float(lengths[k]), _DIGITS),
            round(float(min(grades[k], 1e6)), _DIGITS),
            [tuple(row) for row in network.lrud_m[k].round(_DIGITS).tolist()],
        )
        for k, (a, b) in enumerate(network.shots.tolist())
    ]
    return LegNetwork(
        {names[n]: tuple(places[n].tolist()) for n in used.tolist()},
        legs,
        [names[n] for n in used[degree > 2].tolist()],
        [names[n] for n in used[degree == 1].tolist()],
        [name for name in lines_of(surveyed.entrances) if name in set(names)],
        len(legs) - len(used) + pieces,
        pieces,
        round(float(lengths.sum()), _DIGITS),
        sorted(names_between(surveyed).intersection(names)),
    )


@dataclass(frozen=True)
class Start:
    """Where robots start, m, mine frame: the anchor on a floor, its clearance, and the middle of its region."""

    anchor_m: Place
    anchor_clearance_m: float
    centre_m: Place
    radius_m: float
    clearance_m: float


def start_of(
    cells: FloorSpans,
    network: LegNetwork,
    stated_m: Sequence[float] | None,
    spawn: SpawnParams,
    robot: RobotSize,
    datum_m: float = 0.0,
) -> Start:
    """Choose where robots start: the span with the largest clearance near a place, nearer ones first.

    The place is the stated one, else the first entrance, else the highest end of a leg, of those from which the
    robot reaches the largest floor on which it has room to start. `datum_m` is the elevation of z = 0, for messages.

    Raises
    ------
    GeometryError
        If nowhere near the place a robot has room. The message names the place and what moves it.
    """
    radius_m, clearance_m = spawn.radius_m, spawn.clearance_m
    roomy = (cells.storey >= 0) & (cells.clearance_m >= clearance_m)
    if stated_m is not None:
        found = _near(cells, roomy, stated_m, radius_m)
        if found is None:
            shown = [*stated_m[:2], *(z + datum_m for z in stated_m[2:])]
            raise GeometryError(
                f"survey.entrance_m = {shown}: within {radius_m:g} m no floor is {clearance_m:g} m from rock; --start "
                "moves it"
            )
        return _start(cells, found, stated_m, radius_m, clearance_m)
    if not roomy.any():
        roomiest = float(cells.clearance_m[cells.storey >= 0].max(initial=0.0))
        raise GeometryError(
            f"no floor is {clearance_m:g} m from rock with a robot's height over it, where robots start: the roomiest "
            f"is {roomiest:.2f} m; compile3d.spawn.clearance_m and compile3d.volume.robot_height_m state less"
        )
    region = regions_of(cells, roomy, robot)
    largest = roomy & (region == region[roomy].min())
    ends = sorted(network.dead_ends or network.stations_m, key=lambda name: (-network.stations_m[name][2], name))
    for name in [*network.entrances, *ends]:
        place = network.stations_m[name]
        found = _near(cells, largest, place, radius_m)
        if found is not None:
            return _start(cells, found, place, radius_m, clearance_m)
    found = int(np.flatnonzero(largest)[0])
    return _start(cells, found, cells.roomiest_m[found].tolist(), radius_m, clearance_m)


def _near(cells: FloorSpans, usable: np.ndarray, place: Sequence[float], radius_m: float) -> int | None:
    """Return the usable span with the largest clearance within half the radius of a place, or else the whole radius."""
    places = cells.roomiest_m
    apart = np.hypot(places[:, 0] - place[0], places[:, 1] - place[1])
    far = np.abs(places[:, 2] - place[2]) if len(place) > 2 else np.zeros(len(places))
    for reach in (radius_m / 2, radius_m):
        near = np.flatnonzero(usable & (apart <= reach) & (far <= max(_AROUND_M, reach)))
        if len(near):
            return int(near[np.lexsort((near, apart[near].round(3), -cells.clearance_m[near].round(3)))[0]])
    return None


def _start(cells: FloorSpans, span: int, centre: Sequence[float], radius_m: float, clearance_m: float) -> Start:
    x, y, z = cells.roomiest_m[span].round(_DIGITS).tolist()
    middle = (float(centre[0]), float(centre[1]), float(centre[2]) if len(centre) > 2 else z)
    return Start((x, y, z), round(float(cells.clearance_m[span]), _DIGITS), middle, radius_m, clearance_m)


def heading_at(network: LegNetwork, place_m: Place) -> float:
    """Return the heading, rad, of the flattest leg near a place, away from its nearer end."""
    places = network.stations_m
    best, heading = math.inf, 0.0
    for leg in network.legs:
        if leg.grade > STEEPEST:
            continue
        a, b = np.array(places[leg.start]), np.array(places[leg.end])
        share = np.clip((np.array(place_m) - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        apart = float(np.linalg.norm(a + share * (b - a) - place_m))
        if apart < best:
            way = (b - a) if share <= 0.5 else (a - b)
            best, heading = apart, math.atan2(way[1], way[0])
    return heading
