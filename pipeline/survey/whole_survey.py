"""A survey's legs as they are, for a world that is built as one volume: nothing is too steep."""

from __future__ import annotations

import math
from dataclasses import replace
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np
from shapely import MultiPolygon
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import InputError, first_few, one_line
from minesurveys.frames import Source
from minesurveys.remarks import warn_user
from minesurveys.solved.model import LegFlag, SolvedSurvey
from minesurveys.solved_surveys import entrances_of, names_of, solve_file
from pipeline.geometry.outline.enclosure import as_polygons
from pipeline.params.survey import PassageSurveyParams
from pipeline.survey.passages.legs import legs_of, pack_legs
from pipeline.survey.passages.pieces import require_near
from pipeline.survey.passages.relief import has_relief, roofs_of, usual_roof_m
from pipeline.survey.passages.survey_leg import SurveyLeg, shots_of
from pipeline.survey.passages.ties import passages_of_ties, ties_of
from pipeline.survey.passages.workings import build_workings, require_area
from pipeline.survey.solved.plan_view import plan_legs, with_sides
from pipeline.survey.solved.station_table import read_station_legs, survey_of_legs
from pipeline.types import Piece, SurveyedLegs, text_array

_NAME_CHARS = 40  # of a station
_HALF_WIDTH_M = 1.0  # in the plan, of a shaft that nobody measured
_NO_LENGTH_M = 1e-3


def read_whole(path: Path, params: PassageSurveyParams) -> tuple[SolvedSurvey, list[SurveyLeg]]:
    """Read a station survey, with elevations or without, and its legs; `InputError` if it cannot be read.

    Legs of a table without relief, which is built as a plan, are those of the table.
    """
    if path.suffix.lower() != ".csv":
        survey = solve_file(path, params.declination_deg)
        return survey, whole_legs(path, survey, params.half_width_m)
    legs = read_station_legs(path, params.grade if isinstance(params.grade, dict) else None, params.columns, params)
    survey, has_grades = survey_of_legs(path, legs), any(leg.grades is not None for leg in legs)
    if not has_relief(legs, params):
        return survey, _with_walls(path, legs, params.half_width_m)
    legs = plan_legs(path, survey, params.half_width_m)
    ungraded = [np.full(len(leg.stations) - 1, np.nan) if has_grades else None for leg in legs]
    return survey, [replace(leg, grades=grades) for leg, grades in zip(legs, ungraded, strict=True)]


def whole_legs(path: Path, survey: SolvedSurvey, half_width_m: float | None) -> list[SurveyLeg]:
    """Return the legs of a solved survey, with repeated ones that alone join pieces; `InputError` without widths."""
    _warn_of_surface(path, survey)
    legs = plan_legs(path, survey, half_width_m)
    if all(np.isnan(leg.lrud_m[:, 3]).all() for leg in legs):
        warn_user("no station has a distance down to the floor; floors are at the stations", of=path.name)
    lone = passages_of_ties(legs, ties_of(survey))
    if lone:
        listed = [f"{leg.stations[0]} to {leg.stations[-1]}" for leg in lone]
        warn_user(
            f"repeated legs alone lead to what hangs on them, and are built: {first_few(listed)}",
            of=path.name,
            count=len(lone),
        )
    return legs + lone


def _warn_of_surface(path: Path, survey: SolvedSurvey) -> None:
    """Warn of what is flagged as on the surface: after a flag that nobody ended, drifts are left out too."""
    legs = survey.legs[(survey.leg_flags & (LegFlag.SURFACE | LegFlag.SPLAY)) == LegFlag.SURFACE]
    if not len(legs):
        return
    places, node, names = survey.nodes()
    ends = node[legs]
    lengths = np.linalg.norm(places[ends[:, 0]] - places[ends[:, 1]], axis=1)
    a, b = ends[lengths.argmax()].tolist()
    warn_user(
        f"legs, {lengths.sum():.0f} m, are flagged as on the surface (of Compass: not plotted) and are no passages; "
        f"the longest is {names[a]} to {names[b]}",
        of=path.name,
        count=len(legs),
    )


def _with_walls(path: Path, legs: list[SurveyLeg], half_width_m: float | None) -> list[SurveyLeg]:
    """Return legs without elevations, or level ones, with a distance to both walls at each station, as `plan_legs`."""
    if not any(np.isnan(leg.walls_m).any() for leg in legs if not leg.is_plumb):
        return legs
    driven = [leg for leg in legs if not leg.is_plumb]
    unknown = [np.full((len(leg.stations), 2), np.nan) for leg in driven]
    rows = [
        (list(range(len(leg.stations))), np.column_stack([leg.walls_m, roof]))
        for leg, roof in zip(driven, unknown, strict=True)
    ]
    filled, _ = with_sides(path, rows, half_width_m)
    walled = [replace(leg, walls_m=walls[:, :2]) for leg, (_, walls) in zip(driven, filled, strict=True)]
    return walled + [leg for leg in legs if leg.is_plumb]


def built_piece(path: Path, survey: SolvedSurvey, legs: list[SurveyLeg], piece: Piece | None) -> SurveyedLegs:
    """Return the longest piece of a survey, or the one that the user names; others are listed in a warning.

    It is in the survey's frame, with its lowest floor, rounded down to metres, at height 0.
    """
    built, others = legs_of_piece(path, survey, legs, piece)
    _warn_of_roofs(path, built)
    stations, names = {name for leg in built for name in leg.stations}, names_of(survey)
    floors = np.concatenate([leg.places_m[:, 2] - np.nan_to_num(leg.lrud_m[:, 3]) for leg in built])
    datum = float(np.floor(floors.min()))
    return pack_legs(
        built,
        (0.0, 0.0, datum),
        surveyed_m=sum(map(_length_m, legs)),
        datum_m=datum,
        entrances=text_array(sorted({names[name] for name in entrances_of(survey)} & stations)),
        pieces=text_array([name for name, _ in others]),
        pieces_m=np.array([length for _, length in others]),
        sources=np.concatenate([leg.known for leg in built]).astype(np.uint8),
        between=np.concatenate([~leg.surveyed for leg in built]).astype(np.uint8),
        splays_m=splays_from(built) - np.array([0.0, 0.0, datum]),
    )


def from_origin(surveyed: SurveyedLegs, origin: tuple[float, float]) -> SurveyedLegs:
    """Return legs in the mine frame, whose origin (east, north) m is stated in theirs."""
    moved = np.array([*origin, 0.0])
    return replace(surveyed, positions_m=surveyed.positions_m - moved, splays_m=surveyed.splays_m - moved)


def _warn_of_roofs(path: Path, legs: list[SurveyLeg]) -> None:
    """Warn of the stations without a measured roof, with what is taken."""
    roofs, usual = roofs_of(legs), usual_roof_m(legs)
    unknown = {name for name, tall in roofs.items() if np.isnan(tall)}
    roofed = [leg for leg in legs if 2 * (leg.known[leg.surveyed, 2] == Source.MEASURED).mean() >= 1]
    between = {name for leg in roofed for name in leg.stations} & unknown
    taken = "compile3d.height_m" if usual is None else f"{usual:.2f} m"
    source = "" if usual is None else ", the median of the others"
    if count := len(unknown - between):
        warn_user(
            f"stations have no measured roof; {taken} over the floor is taken{source}, and less under "
            "floors that pass over it",
            of=path.name,
            count=f"{count} of {len(roofs)}",
            option="compile3d.height_m, compile3d.volume.roof_m=M" if usual is None else "compile3d.volume.roof_m=M",
            advice="compile3d.volume.roof_m=M states another",
        )
    if between:
        warn_user(
            "stations have no measured roof, but most of their passage; its height over the floor is "
            "interpolated between these",
            of=path.name,
            count=f"{len(between)} of {len(roofs)}",
        )


def splays_from(legs: list[SurveyLeg]) -> np.ndarray:
    """Return the splays (k, 2, 3) m from stations of legs, start and end, each once."""
    found = [leg.splays_m for leg in legs if leg.splays_m is not None and len(leg.splays_m)]
    return np.unique(np.concatenate(found), axis=0) if found else np.zeros((0, 2, 3))


def seen_from_above(path: Path, legs: SurveyedLegs) -> MultiPolygon:
    """Return the view of legs from above, m, mine frame; `InputError` if it has no area."""
    return as_polygons(footprint(path, legs_of(legs)))


def footprint(path: Path, legs: list[SurveyLeg]) -> BaseGeometry:
    """Return the union of the legs seen from above (m, the legs' frame); shafts that nobody measured are 2 m wide.

    Each shot is as wide as at its stations, square to itself.

    Raises
    ------
    InputError
        If it has no area.
    """
    walls = [np.where(np.isfinite(leg.walls_m), leg.walls_m, _HALF_WIDTH_M) for leg in legs]
    wide = [replace(leg, walls_m=w) for leg, w in zip(legs, walls, strict=True)]
    built = build_workings([shot for leg in wide for shot in shots_of(leg)])
    require_area(path, built, legs)
    return built


def _length_m(leg: SurveyLeg) -> float:
    """Return the length of a leg, m, from its first station to its last: a face beyond them is not surveyed."""
    return float(np.linalg.norm(np.diff(leg.places_m[leg.surveyed], axis=0), axis=1).sum())


def legs_of_piece(
    path: Path, survey: SolvedSurvey, legs: list[SurveyLeg], piece: Piece | None
) -> tuple[list[SurveyLeg], list[tuple[str, float]]]:
    """Return the legs of the chosen piece, and a station and the length of each other one, with a warning of them."""
    graph: nx.Graph = nx.Graph()
    for tie in ties_of(survey):
        graph.add_edge(*tie.stations, length=0.0)
    for leg in legs:
        for (a, b), step in zip(
            pairwise(leg.stations), np.linalg.norm(np.diff(leg.places_m, axis=0), axis=1).tolist(), strict=True
        ):
            graph.add_edge(a, b, length=step)
    built = {name for leg in legs for name in leg.stations}
    found = [  # exact sums, as the order of the nodes changes from run to run
        (math.fsum(nx.get_edge_attributes(graph.subgraph(nodes), "length").values()), min(nodes & built), nodes)
        for nodes in nx.connected_components(graph)
        if nodes & built
    ]
    found.sort(key=lambda one: (-one[0], one[1]))
    station = None if piece is None else _station(path, survey, legs, piece)
    length, about, nodes = found[0] if station is None else next(one for one in found if station in one[2])
    if not length > _NO_LENGTH_M:
        raise InputError(f"{path}: the legs about station {about} have no length; nothing to build")
    others = [(name, metres) for metres, name, stations in found if stations is not nodes]
    if others:
        about = _about(survey, legs, about)
        lengths = [f"{metres:.0f} m about {_about(survey, legs, name)}" for name, metres in others]
        warn_user(
            f"pieces share no station; built is the one of {length:.0f} m about {about}",
            of=path.name,
            count=len(found),
            option="--piece, survey.piece",
            advice=f"--piece (survey.piece) builds another: {first_few(lengths)}",
        )
    return [leg for leg in legs if leg.stations[0] in nodes], others


def _about(survey: SolvedSurvey, legs: list[SurveyLeg], station: str) -> str:
    """Return what names a station to the user, as --piece takes it: its name, or its place."""
    if survey.is_named and not station.startswith("unnamed "):
        return one_line(station, _NAME_CHARS)
    leg = next(leg for leg in legs if station in leg.stations)
    return ",".join(f"{value:.1f}" for value in leg.places_m[leg.stations.index(station)])


def _station(path: Path, survey: SolvedSurvey, legs: list[SurveyLeg], piece: Piece) -> str:
    """Return the station that a name or a place (easting, northing, elevation) stands for.

    Raises
    ------
    InputError
        If there is none, with names like it, or the nearest one is more than 10 m away.
    """
    names = list(dict.fromkeys(name for leg in legs for name in leg.stations))
    if isinstance(piece, str):
        named = names_of(survey).get(piece, piece)
        if named in names:
            return named
        near = ", ".join(one_line(name, _NAME_CHARS) for name in get_close_matches(piece, names, n=3, cutoff=0.0))
        raise InputError(
            f"{path}: survey.piece = {one_line(piece, _NAME_CHARS)!r}: no station has this name; names like it are "
            f"{near}"
        )
    places = np.concatenate([leg.places_m for leg in legs])
    far = np.linalg.norm(places - piece, axis=1)
    station = [name for leg in legs for name in leg.stations][int(far.argmin())]
    require_near(path, piece, float(far.min()), f"the nearest station, {one_line(station, _NAME_CHARS)},")
    return station
