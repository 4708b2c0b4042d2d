"""Therion's words in Survex: names of stations and surveys, units, coordinate systems, flags."""

from __future__ import annotations

import re

from minesurveys.errors import InputError
from minesurveys.survex.survex_text import FLAGS, POINT, written_name, written_survey

SKIPPED_BLOCKS = {"map", "scrap", "surface", "grade", "layout", "lookup", "line", "area", "revise", "scan"}
_LONGEST_NAME = 200
_NUMBER = re.compile(r"[+-]?(\d{1,12}\.?\d{0,17}|\.\d{1,17})(e[+-]?\d{1,2})?", re.IGNORECASE)
_SEXAGESIMAL = re.compile(r"([+-]?)(\d{1,3}):(\d{1,2}(?:\.\d{0,12})?)(?::(\d{1,2}(?:\.\d{0,12})?))?")
# Therion has no units and corrections of backsights alone: they have those of their instrument.
_LENGTH, _COMPASS, _CLINO = "length backlength", "compass backcompass", "clino backclino"
QUANTITIES = {
    "length": _LENGTH, "tape": _LENGTH, "compass": _COMPASS, "bearing": _COMPASS, "clino": _CLINO, "gradient": _CLINO,
    "counter": "counter", "count": "counter", "depth": "depth", "dx": "dx", "dy": "dy", "dz": "dz", "easting": "dx",
    "northing": "dy", "altitude": "dz", "left": "left", "right": "right", "up": "up", "ceiling": "up", "down": "down",
    "floor": "down", "dimensions": "left right up down", "x": "x", "y": "y", "z": "z",
    "position": "x y z", "declination": "declination",
}  # fmt: skip
UNITS = {
    "m": "metres", "meter": "metres", "meters": "metres", "metre": "metres", "metres": "metres", "metric": "metres",
    "ft": "feet", "foot": "feet", "feet": "feet", "feets": "feet", "yd": "yards", "yard": "yards", "yards": "yards",
    "degree": "degrees", "degrees": "degrees", "deg": "degrees", "degs": "degrees", "grad": "grads", "grads": "grads",
    "minute": "minutes", "minutes": "minutes", "min": "minutes", "mil": "mils", "mils": "mils", "percent": "percent",
    "percentage": "percent",
}  # fmt: skip
SMALL = {
    "mm": 0.001, "millimeter": 0.001, "millimeters": 0.001, "millimetre": 0.001, "millimetres": 0.001,
    "cm": 0.01, "centimeter": 0.01, "centimeters": 0.01, "centimetre": 0.01, "centimetres": 0.01,
    "in": 0.0254, "inch": 0.0254, "inches": 0.0254,
}  # fmt: skip
# mils are grads: findings/therion-mils-are-grads.sh
DEGREES = {"degrees": 1.0, "grads": 0.9, "minutes": 1 / 60, "mils": 0.9}


def require_name(where: str, name: str) -> str:
    """Return a name of a survey or a station, or refuse one that no program shows."""
    if not name or not name.isprintable() or len(name) > _LONGEST_NAME:
        raise InputError(f"{where}: name {name[:60]!r}: want 1 to {_LONGEST_NAME} printable characters")
    return name


def station_for_survex(where: str, name: str) -> str:
    """Return `outer.inner.station` for Therion's `station@inner.outer`; splay ends `-` and `.` become `..` and `.`."""
    if name in ("-", "."):
        return ".." if name == "-" else "."
    station, _, surveys = name.partition("@")
    outer = [written_survey(require_name(where, part)) for part in reversed(surveys.split("."))] if surveys else []
    if station.startswith("."):
        raise InputError(f"{where}: station {name[:60]!r}: a name does not begin with a point")
    inner = POINT.join(written_name(part) for part in require_name(where, station).split("."))
    return ".".join([*outer, inner])


def number_for_survex(where: str, word: str) -> str:
    """Return a plain decimal number, or refuse the word. `4:30` is degrees and minutes, `1e3` a thousand."""
    parts = _SEXAGESIMAL.fullmatch(word)
    if parts:
        degrees = float(parts[2]) + float(parts[3]) / 60 + float(parts[4] or 0) / 3600
        return f"{parts[1]}{degrees:.9f}"
    if not _NUMBER.fullmatch(word):
        raise InputError(f"{where}: {word[:40]!r} is not a number")
    return word if "e" not in word.lower() else f"{float(word):.9f}"


def changed_flags(where: str, flags: frozenset[str], words: tuple[str, ...]) -> frozenset[str]:
    """Return flags of shots after the words of `flags`; `approximate` changes nothing here and is left out."""
    is_not = False
    for word in (word.lower() for word in words):
        if word == "not":
            is_not = True
            continue
        if word in FLAGS:
            flags = flags - {word} if is_not else flags | {word}
        elif word not in ("approx", "approximate"):
            raise InputError(f"{where}: flag {word[:40]!r} is not supported")
        is_not = False
    return flags
