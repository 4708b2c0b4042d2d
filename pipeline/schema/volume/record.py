"""The table of `world.json` of a volume: that of other worlds, with the volume's figures in place of a height."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from minexplore.bundle import RECORD, BundleError
from minexplore.floors.volume_arrays import VolumeArrays
from minexplore.sealed.sizes import MOST_FACETS, MOST_SPANS, MOST_VOLUME_PARTS
from pipeline.schema.record import (
    LENGTH,
    MOST_LIGHTS,
    REACH_M,
    RECORD_FIELDS,
    check_fields,
    check_frame,
    check_gain,
    check_zones,
    shown,
)
from pipeline.schema.rules import Rule, list_of, number, whole
from pipeline.schema.volume.arrays import figures_of

_PLACE = list_of(number(-REACH_M, REACH_M), 3)
_MOST_ENDS, _MOST_NAME = 100_000, 200  # stations, and characters of a station's name


def _check_ends(where: str, ends: Any) -> None:
    if not isinstance(ends, list) or len(ends) > _MOST_ENDS:
        raise BundleError(f"{where} = {shown(ends)}: want a list of at most {_MOST_ENDS} stations")
    for at, end in enumerate(ends):
        name = end.get("station") if isinstance(end, dict) else None
        if not isinstance(name, str) or len(name) > _MOST_NAME or set(end) != {"station", "place_m"}:
            raise BundleError(
                f"{where}[{at}] = {shown(end)}: want a station, of 1 to {_MOST_NAME} letters, and place_m"
            )
        if not _PLACE.accepts(end["place_m"]):
            raise BundleError(f"{where}[{at}].place_m = {shown(end['place_m'])}: want {_PLACE.wants}")


_FIGURES = {
    "facets": whole(4, MOST_FACETS),
    "vertices": whole(4, MOST_FACETS),
    "parts": whole(1, MOST_VOLUME_PARTS),
    "floors": whole(0, MOST_VOLUME_PARTS),
    "storeys": whole(1, MOST_SPANS),
    "low_m": number(-REACH_M, REACH_M),
    "high_m": number(-REACH_M, REACH_M),
    "surveyed_m": LENGTH,
    "piece_m": LENGTH,
    "built_m": LENGTH,
    "datum_m": number(-REACH_M, REACH_M),
    "entrances": _check_ends,
    "closed_ends": _check_ends,
    "is_drawn": Rule(lambda value: isinstance(value, bool), "true or false"),
}
VOLUME_FIELDS: dict[str, Any] = {
    **{name: rule for name, rule in RECORD_FIELDS.items() if name != "height_m"},
    "tilt_deg": number(0, 0),
    "lights": whole(0, MOST_LIGHTS),
    "collision_parts": whole(1, MOST_VOLUME_PARTS),
    "volume": _FIGURES,
}


def check_volume_record(record: Mapping[str, Any]) -> None:
    """Refuse a record with a field that is missing, unknown or out of range, or whose fields contradict one another.

    Raises
    ------
    BundleError
        Naming the field, its value and the limit.
    """
    check_fields(RECORD, record, VOLUME_FIELDS)
    figures = record["volume"]
    check_frame(RECORD, record)
    check_gain(RECORD, record, figures["high_m"] - figures["low_m"])
    check_zones(RECORD, record)
    x, y, z = record["spawn"]["anchor_m"]
    if not figures["low_m"] <= z < figures["high_m"]:
        raise BundleError(f"{RECORD}: spawn.anchor_m = [{x}, {y}, {z}]: want a place in the volume")
    if figures["parts"] != record["collision_parts"]:
        raise BundleError(f"{RECORD}: volume.parts = {figures['parts']}: want collision_parts")
    if not figures["built_m"] <= figures["piece_m"] <= figures["surveyed_m"]:
        raise BundleError(f"{RECORD}: volume.built_m = {figures['built_m']}: want at most piece_m and surveyed_m")


def check_figures(record: Mapping[str, Any], volume: VolumeArrays) -> None:
    """Refuse a record that differs from its arrays.

    Raises
    ------
    BundleError
        Naming the field.
    """
    for name, value in figures_of(volume).items():
        if record["volume"][name] != value:
            raise BundleError(f"{RECORD}: volume.{name} = {record['volume'][name]}: the bundle's arrays have {value}")
    low, high = (getattr(volume.facets.vertices[:, :2], end)(axis=0) for end in ("min", "max"))
    west, south, east, north = record["world_m"]
    if not (west <= low[0] and south <= low[1] and east >= high[0] and north >= high[1]):
        raise BundleError(f"{RECORD}: world_m = {record['world_m']}: the volume reaches beyond it")
    if int(volume.facets.leg.max()) >= record["drifts"]:
        raise BundleError(f"{RECORD}: drifts = {record['drifts']}: a facet is of leg {int(volume.facets.leg.max())}")
