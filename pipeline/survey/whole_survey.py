"""A survey's legs as they are, for a world that is built as one volume: no sheets, and nothing is too steep."""

from __future__ import annotations

from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np
from shapely import MultiPolygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import InputError
from pipeline.geometry.outline.enclosure import as_polygons
from pipeline.guard.reading_process import one_line, warn_user
from pipeline.params.survey import CentrelineSurveyParams, PassageSurveyParams
from pipeline.survey.formats import is_solved, leg_reader
from pipeline.survey.passages.legs import SurveyLeg, build_workings, legs_of
from pipeline.survey.solved.model import SolvedSurvey, StationFlag
from pipeline.survey.solved.plan_view import plan_legs
from pipeline.survey.solved_surveys import solve_file
from pipeline.survey.stations.table import read_station_legs
from pipeline.types import Piece, SurveyedLegs, text_array

_NEAR_M = 10.0  # from a stated place to the station that it names
_NAMED = 10  # pieces that a message names
_NAME_CHARS = 40
_HALF_WIDTH_M = 1.0  # in the plan, of a shaft that nobody measured
_NO_LENGTH_M = 1e-3


@dataclass(frozen=True)
class WholeSurvey:
    """All legs of a survey in its own frame, the names of its entrances, and its coordinate system."""

    legs: list[SurveyLeg]
    entrances: list[str]
    crs: str | None


def read_whole(path: Path, params: PassageSurveyParams) -> WholeSurvey:
    """Read a station survey with elevations.

    Raises
    ------
    InputError
        If it cannot be read, or has no elevations.
    """
    if isinstance(params.grade, dict):  # of the legs of a station table
        legs, crs, entrances = read_station_legs(path, params.grade), None, []
    elif is_solved(path) or path.suffix.lower() == ".csv":
        survey = solve_file(path)
        legs = plan_legs(path, survey, params.half_width_m)
        crs = None if survey.crs is None else one_line(survey.crs, 200)
        entrances = entrances_of(survey)
    else:
        (legs, crs), entrances = leg_reader(path)(path, params.half_width_m), []
    return WholeSurvey(_with_heights(path, legs), entrances, crs)


def entrances_of(survey: SolvedSurvey) -> list[str]:
    """Return the names of the stations that are open to the surface."""
    is_open = (survey.station_flags & StationFlag.ENTRANCE) != 0
    return sorted({survey.names[k] for k in np.flatnonzero(is_open)} - {""})


def _with_heights(path: Path, legs: list[SurveyLeg]) -> list[SurveyLeg]:
    flat = next((leg for leg in legs if leg.heights_m is None), None)
    if flat is not None:
        raise InputError(
            f"{path}: leg {flat.name} has no elevations, and --volume (survey.volume) builds surveys with them; "
            "without the option it is built as a level mine"
        )
    return legs


def surveyed_legs(
    path: Path,
    survey: WholeSurvey,
    params: PassageSurveyParams | CentrelineSurveyParams,
    origin: tuple[float, float],
) -> SurveyedLegs:
    """Return the legs of the longest piece, or of the one that the user names, in the mine frame.

    Others are listed. The frame's height 0 is the lowest floor, rounded down to metres.
    """
    kept, others = _pieces(path, survey.legs, params.piece)
    places = [_places(leg) for leg in kept]
    lrud = np.concatenate([np.column_stack([leg.walls_m, _heights(leg)[:, 1:]]) for leg in kept])
    floors = np.concatenate(places)[:, 2] - np.nan_to_num(lrud[:, 3])
    datum = float(np.floor(floors.min()))
    start = _start(params.entrance_m, datum)
    stations = [name for leg in kept for name in leg.stations]
    return SurveyedLegs(
        np.concatenate(places) - np.array([*origin, datum]),
        lrud,
        np.concatenate([[0], np.cumsum([len(leg.stations) for leg in kept])]).astype(np.int32),
        text_array(stations),
        text_array([name for name in survey.entrances if name in set(stations)]),
        start,
        text_array([name for name, _ in others]),
        np.array([length for _, length in others]),
        sum(map(_length_m, survey.legs)),
        datum,
    )


def whole_in_frame(
    path: Path,
    survey: WholeSurvey,
    params: PassageSurveyParams | CentrelineSurveyParams,
    origin: tuple[float, float],
) -> tuple[SurveyedLegs, MultiPolygon]:
    """Return the legs that are built, in the mine frame, and their view from above; see `surveyed_legs`."""
    legs = surveyed_legs(path, survey, params, origin)
    return legs, as_polygons(footprint(path, legs_of(legs)))


def footprint(path: Path, legs: list[SurveyLeg]) -> BaseGeometry:
    """Return the union of the legs seen from above (m, the legs' frame); shafts that nobody measured are 2 m wide.

    Raises
    ------
    InputError
        If it has no area.
    """
    walls = [np.where(np.isfinite(leg.walls_m), leg.walls_m, _HALF_WIDTH_M) for leg in legs]
    built = build_workings([replace(leg, walls_m=w) for leg, w in zip(legs, walls, strict=True)])
    if built.is_empty:
        raise InputError(f"{path}: the stations' walls enclose no area")
    return built


def _start(stated: tuple[float, ...] | None, datum: float) -> np.ndarray:
    if stated is None:
        return np.zeros(0)
    return np.array([*stated[:2], *(z - datum for z in stated[2:])])


def _heights(leg: SurveyLeg) -> np.ndarray:
    assert leg.heights_m is not None
    return leg.heights_m


def _places(leg: SurveyLeg) -> np.ndarray:
    return np.column_stack([leg.positions_m, _heights(leg)[:, 0]])


def _length_m(leg: SurveyLeg) -> float:
    return float(np.linalg.norm(np.diff(_places(leg), axis=0), axis=1).sum())


def _pieces(path: Path, legs: list[SurveyLeg], piece: Piece | None) -> tuple[list[SurveyLeg], list[tuple[str, float]]]:
    """Return the legs of the chosen piece, and a station and the length of each other one, with a warning of them."""
    graph: nx.Graph = nx.Graph()
    for leg in legs:
        for (a, b), step in zip(
            pairwise(leg.stations), np.linalg.norm(np.diff(_places(leg), axis=0), axis=1).tolist(), strict=True
        ):
            graph.add_edge(a, b, length=step)
    found = [
        (float(graph.subgraph(nodes).size(weight="length")), min(nodes), nodes)
        for nodes in nx.connected_components(graph)
    ]
    found.sort(key=lambda one: (-one[0], one[1]))
    station = None if piece is None else _station(path, legs, piece)
    length, about, nodes = found[0] if station is None else next(one for one in found if station in one[2])
    if not length > _NO_LENGTH_M:
        raise InputError(f"{path}: the legs about station {about} have no length; nothing to build")
    others = [(name, metres) for metres, name, stations in found if stations is not nodes]
    if others:
        listed = ", ".join(f"{metres:.0f} m about {one_line(name, _NAME_CHARS)}" for name, metres in others[:_NAMED])
        more = f", and {len(others) - _NAMED} more" if len(others) > _NAMED else ""
        warn_user(
            f"{path.name}: {len(found)} pieces share no station; built is the one of {length:.0f} m about "
            f"{one_line(about, _NAME_CHARS)}; --piece (survey.piece) builds another: {listed}{more}"
        )
    return [leg for leg in legs if leg.stations[0] in nodes], others


def _station(path: Path, legs: list[SurveyLeg], piece: Piece) -> str:
    """Return the station that a name or a place (easting, northing, elevation) stands for.

    Raises
    ------
    InputError
        If there is none, with names like it, or the nearest one is more than 10 m away.
    """
    names = list(dict.fromkeys(name for leg in legs for name in leg.stations))
    if isinstance(piece, str):
        if piece in names:
            return piece
        near = ", ".join(one_line(name, _NAME_CHARS) for name in get_close_matches(piece, names, n=3, cutoff=0.0))
        raise InputError(
            f"{path}: survey.piece = {one_line(piece, _NAME_CHARS)!r}: no station has this name; names like it are "
            f"{near}"
        )
    places = np.concatenate([_places(leg) for leg in legs])
    far = np.linalg.norm(places - piece, axis=1)
    station = [name for leg in legs for name in leg.stations][int(far.argmin())]
    if not far.min() <= _NEAR_M:
        stated = ",".join(f"{value:g}" for value in piece)
        raise InputError(
            f"{path}: survey.piece = {stated}: the nearest station, {one_line(station, _NAME_CHARS)}, is "
            f"{far.min():.1f} m away, at most {_NEAR_M:g} m"
        )
    return station
