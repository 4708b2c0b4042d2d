"""The table of `topology.json` of a world that is one volume: its stations and legs, within the reach of its mesh."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from minexplore.bundle import RECORD, TOPOLOGY, BundleError
from minexplore.floors.volume_arrays import VolumeFacets
from pipeline.schema.record import LENGTH, REACH_M, check_fields, shown
from pipeline.schema.rules import Rule, is_number, list_of, number, whole

MOST_NAME = 200  # characters of a station's name
_BEYOND_M = 10.0  # the mesh: stations are in the workings, or on their walls
_LENGTH_M = 0.01  # by which a leg may be longer or shorter than from station to station: places have four decimals
_STEEPEST = 1e6  # of a plumb leg: the largest number that is written
_NAME = Rule(lambda value: isinstance(value, str) and len(value) <= MOST_NAME, f"a name of {MOST_NAME} letters at most")
_LEG = {
    "name": _NAME,
    "start": _NAME,
    "end": _NAME,
    "length_m": LENGTH,
    "grade": number(0, _STEEPEST),
    "lrud_m": list_of(list_of(LENGTH, 4), 2),
}


_NAMED = ("junctions", "dead_ends", "entrances", "between")  # fields of stations


def check_network(record: Mapping[str, Any], network: Any, facets: VolumeFacets) -> None:
    """Refuse a network of legs whose fields, names or sizes no survey of this mesh has.

    Raises
    ------
    BundleError
        Naming the field, its value and what is wanted.
    """
    check_fields(
        f"{TOPOLOGY}: network",
        network,
        {
            "stations_m": _check_stations,
            "legs": _check_legs,
            **dict.fromkeys(_NAMED, _check_names),
            "loops": whole(0, 1_000_000),
            "components": whole(1, 1_000_000),
            "total_length_m": LENGTH,
        },
    )
    stations, legs = network["stations_m"], network["legs"]
    if len(legs) != record["drifts"]:
        raise BundleError(f"{TOPOLOGY}: {len(legs)} legs: want as many legs as {RECORD} has drifts, {record['drifts']}")
    numbers = {name: number for number, name in enumerate(stations)}
    for name in _NAMED:
        for station in network[name]:
            if station not in numbers:
                raise BundleError(f"{TOPOLOGY}: {name}: {station[:40]!r} is none of stations_m")
    for at, leg in enumerate(legs):
        if leg["start"] not in numbers or leg["end"] not in numbers:
            raise BundleError(f"{TOPOLOGY}: legs[{at}]: want start and end, two of stations_m")
    places = np.array(list(stations.values()), np.float64)
    _require_near(list(stations), places, facets)
    ends = np.array([[numbers[leg["start"]], numbers[leg["end"]]] for leg in legs])
    _require_lengths(network, np.linalg.norm(places[ends[:, 1]] - places[ends[:, 0]], axis=1))
    _require_sections(legs, facets)


def _check_stations(where: str, stations: Any) -> None:
    if not isinstance(stations, dict) or not stations:
        raise BundleError(f"{where} = {shown(stations)}: want stations and their places")
    for name, place in stations.items():
        is_place = isinstance(place, list) and len(place) == 3 and all(map(is_number, place))
        if len(name) > MOST_NAME or not is_place:
            raise BundleError(f"{where}[{name[:40]!r}] = {shown(place)}: want a name of {MOST_NAME} letters, x, y, z")


def _check_legs(where: str, legs: Any) -> None:
    if not isinstance(legs, list) or not legs:
        raise BundleError(f"{where} = {shown(legs)}: want a list of legs")
    for at, leg in enumerate(legs):
        check_fields(f"{where}[{at}]", leg, _LEG)


def _check_names(where: str, names: Any) -> None:
    if not isinstance(names, list) or not all(map(_NAME.accepts, names)):
        raise BundleError(f"{where} = {shown(names)}: want a list of stations")


def _require_near(names: list[str], places: np.ndarray, facets: VolumeFacets) -> None:
    """Refuse stations (n, 3) m beyond the mesh."""
    low, high = facets.vertices.min(axis=0) - _BEYOND_M, facets.vertices.max(axis=0) + _BEYOND_M
    beyond = np.flatnonzero(~((places >= low) & (places <= high)).all(axis=1))
    if len(beyond):
        at = beyond[0]
        raise BundleError(
            f"{TOPOLOGY}: stations_m[{names[at][:40]!r}] = {places[at].tolist()}: want a place at most {_BEYOND_M:g} m "
            f"beyond the mesh, from {low.round(1).tolist()} to {high.round(1).tolist()}"
        )


def _require_lengths(network: Mapping[str, Any], apart_m: np.ndarray) -> None:
    """Compare the lengths of legs with the distances (l,) m of their stations, and the whole length with their sum."""
    lengths = np.array([leg["length_m"] for leg in network["legs"]], np.float64)
    wrong = np.flatnonzero(np.abs(lengths - apart_m) > _LENGTH_M)
    if len(wrong):
        at = wrong[0]
        raise BundleError(
            f"{TOPOLOGY}: legs[{at}].length_m = {lengths[at]}: its stations are {apart_m[at]:.4f} m apart"
        )
    whole_m = float(lengths.sum())
    if whole_m > REACH_M or abs(network["total_length_m"] - whole_m) > _LENGTH_M * len(lengths):
        raise BundleError(
            f"{TOPOLOGY}: total_length_m = {network['total_length_m']}: its legs have {whole_m:.4f}, want at most "
            f"{REACH_M:g}"
        )


def _require_sections(legs: list[dict[str, Any]], facets: VolumeFacets) -> None:
    """Refuse sections that are wider or higher than the mesh."""
    sizes = np.array([leg["lrud_m"] for leg in legs], np.float64)
    most = float(np.linalg.norm(np.ptp(facets.vertices, axis=0))) + _BEYOND_M
    wrong = np.argwhere(sizes > most)
    if len(wrong):
        at = wrong[0]
        raise BundleError(
            f"{TOPOLOGY}: legs[{at[0]}].lrud_m[{at[1]}][{at[2]}] = {sizes[tuple(at)]}: want at most {most:.1f}, as the "
            "mesh is long"
        )
