"""The numbers of `world.json` that an environment uses. Units are m, rad, kg and s."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from minexplore.bundle import FORMAT, NO_OVERLAY, RECORD, ROUGH_OVERLAY, VOLUME_FORMAT, BundleError, is_volume
from minexplore.limits import Span
from minexplore.sealed.sizes import MOST_ZONES

_REACH_M = 1e6  # of any coordinate
_PLACE, _LENGTH = Span(-_REACH_M, _REACH_M), Span(0, _REACH_M)
_NAME = re.compile(r"[A-Za-z0-9_-]{1,64}", re.ASCII)
_NUMBERS: dict[str, tuple[Span, tuple[int, ...]]] = {
    "T_world_mine": (Span(-2 * _REACH_M, 2 * _REACH_M), (4, 4)),
    "world_m": (_PLACE, (4,)),
    "rock_friction": (Span(1e-6, 2), ()),
    "areas.tunnel_m2": (Span(0, _REACH_M**2), ()),
    "drifts": (Span(1, 1_000_000, whole=True), ()),
    "spawn.anchor_clearance_m": (_LENGTH, ()),
    "spawn.radius_m": (_LENGTH, ()),
    "spawn.clearance_m": (_LENGTH, ()),
}
_LEVEL = {"height_m": (Span(0.5, 50), ()), "spawn.anchor_m": (_PLACE, (2,)), "spawn.centre_m": (_PLACE, (2,))}
_VOLUME = {"spawn.anchor_m": (_PLACE, (3,)), "spawn.centre_m": (_PLACE, (3,))}


def check_record(record: Mapping[str, Any]) -> None:
    """Refuse a record without what an environment reads, or with numbers that no world has.

    `read_zones` checks the zones.

    Raises
    ------
    BundleError
        Naming the field, its value and what is wanted.
    """
    if record.get("format") not in (FORMAT, VOLUME_FORMAT):
        raise BundleError(
            f"{RECORD}: format {record.get('format')!r:.100}, this version reads {FORMAT!r} and {VOLUME_FORMAT!r}"
        )
    if not isinstance(record.get("name"), str) or not _NAME.fullmatch(record["name"]):
        raise _refusal("name", record.get("name"), "1 to 64 letters, digits, _ and -")
    if record.get("overlay") not in (ROUGH_OVERLAY, NO_OVERLAY):
        raise _refusal("overlay", record.get("overlay"), f"{ROUGH_OVERLAY!r} or {NO_OVERLAY!r}")
    zones = record.get("zones")
    if not isinstance(zones, list) or not 1 <= len(zones) <= MOST_ZONES:
        raise _refusal("zones", zones, f"a list of 1 to {MOST_ZONES} zones")
    for path, (span, shape) in {**_NUMBERS, **(_VOLUME if is_volume(record) else _LEVEL)}.items():
        value: Any = record
        for name in path.split("."):
            value = value.get(name) if isinstance(value, dict) else None
        _check(path, value, span, shape)
    west, south, east, north = record["world_m"]
    if not (west < east and south < north):
        raise _refusal("world_m", record["world_m"], "west < east and south < north")
    x, y, *_ = record["spawn"]["anchor_m"]
    if not (west < x < east and south < y < north):
        raise _refusal("spawn.anchor_m", record["spawn"]["anchor_m"], f"a place in world_m = {record['world_m']}")


def _check(path: str, value: Any, span: Span, shape: tuple[int, ...]) -> None:
    """Refuse a value that is not a number of a span, or not lists of so many of them."""
    if not shape:
        if not span.accepts(value):
            raise _refusal(path, value, str(span))
        return
    if not isinstance(value, list) or len(value) != shape[0]:
        raise _refusal(path, value, f"a list of {shape[0]}, of numbers" + (f" {span}" if span else ""))
    for number, inner in enumerate(value):
        _check(f"{path}[{number}]", inner, span, shape[1:])


def _refusal(path: str, value: Any, wanted: str) -> BundleError:
    return BundleError(f"{RECORD}: {path} = {value!r:.100}: want {wanted}")
