"""Therion's words in Survex: names of stations and surveys, units, coordinate systems, flags."""

from __future__ import annotations

import re

from pipeline.errors import InputError

DOT = "~"
SKIPPED_BLOCKS = {"map", "scrap", "surface", "grade", "layout", "lookup", "line", "area"}
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_/'+-]{0,200}")
_QUANTITIES = {
    "length": "length", "tape": "length", "compass": "compass", "bearing": "compass", "clino": "clino",
    "gradient": "clino", "backcompass": "backcompass", "backbearing": "backcompass", "backclino": "backclino",
    "backgradient": "backclino", "counter": "counter", "depth": "depth", "dx": "dx", "dy": "dy", "dz": "dz",
    "easting": "dx", "northing": "dy", "altitude": "dz", "left": "left", "right": "right", "up": "up", "down": "down",
    "position": "position",
}  # fmt: skip
_UNITS = {
    "m": "metres", "meter": "metres", "meters": "metres", "metre": "metres", "metres": "metres", "metric": "metres",
    "ft": "feet", "foot": "feet", "feet": "feet", "feets": "feet", "yd": "yards", "yard": "yards", "yards": "yards",
    "degree": "degrees", "degrees": "degrees", "deg": "degrees", "degs": "degrees", "grad": "grads", "grads": "grads",
    "minute": "minutes", "minutes": "minutes", "min": "minutes", "percent": "percent", "percentage": "percent",
}  # fmt: skip
_SMALL = {"cm": 0.01, "centimeter": 0.01, "centimeters": 0.01, "centimetre": 0.01, "centimetres": 0.01,
          "in": 0.0254, "inch": 0.0254, "inches": 0.0254}  # fmt: skip
_DEGREES = {"degrees": 1.0, "grads": 0.9, "minutes": 1 / 60}
_FLAGS = {"surface", "duplicate", "splay"}


def survey_name(where: str, name: str) -> str:
    """Return a survey's name, or refuse one that Survex cannot hold."""
    if not _NAME.fullmatch(name):
        raise InputError(f"{where}: name {name[:60]!r}: letters, digits and _ - / ' + are read")
    return name


def station_for_survex(where: str, name: str) -> str:
    """Return `outer.inner.station` for Therion's `station@inner.outer`; splay ends `-` and `.` become `..` and `.`."""
    if name in ("-", "."):
        return ".." if name == "-" else "."
    station, _, surveys = name.partition("@")
    parts = [*reversed(surveys.split(".")), station] if surveys else [station]
    *outer, inner = parts
    return ".".join([*(survey_name(where, part) for part in outer), _station_name(where, inner)])


def _station_name(where: str, name: str) -> str:
    """Return a station's name, with `DOT` for the point of names like 2.15: a point parts surveys in Survex."""
    parts = name.split(".")
    if "" in parts:
        raise InputError(f"{where}: station {name[:60]!r}: a name neither begins nor ends with a point")
    return DOT.join(survey_name(where, part) for part in parts)


def units_for_survex(where: str, words: tuple[str, ...]) -> str:
    """Return the words of `units` or `sd`: quantities, an optional number, and a unit."""
    count = next((i for i, word in enumerate(words) if word.lower() not in _QUANTITIES), len(words))
    rest = [word.lower() for word in words[count:]]
    unit = rest[-1] if rest else ""
    factor = float(number_for_survex(where, rest[0])) if len(rest) == 2 else 1.0
    if count == 0 or len(rest) not in (1, 2) or unit not in {**_UNITS, **_SMALL}:
        raise InputError(f"{where}: units {' '.join(words)[:60]!r} are not supported")
    name, factor = (_UNITS[unit], factor) if unit in _UNITS else ("metres", factor * _SMALL[unit])
    number = "" if factor == 1.0 else f"{factor:.10g} "
    return f"{' '.join(_QUANTITIES[word.lower()] for word in words[:count])} {number}{name}"


def numbers_for_survex(where: str, words: tuple[str, ...]) -> str:
    """Return the words of `calibrate`: quantities, the zero error and an optional scale."""
    count = next((i for i, word in enumerate(words) if word.lower() not in _QUANTITIES), len(words))
    numbers = [number_for_survex(where, word) for word in words[count:]]
    if count == 0 or len(numbers) not in (1, 2):
        raise InputError(f"{where}: calibrate {' '.join(words)[:60]!r} is not supported")
    return " ".join([*(_QUANTITIES[word.lower()] for word in words[:count]), *numbers])


def number_for_survex(where: str, word: str) -> str:
    """Return a plain decimal number as it stands, or refuse the word."""
    if not re.fullmatch(r"[+-]?(\d{1,12}\.?\d{0,12}|\.\d{1,12})", word):
        raise InputError(f"{where}: {word[:40]!r} is not a number")
    return word


def declination_for_survex(where: str, words: list[str], convergence_deg: float) -> str:
    """Return Survex's command for one declination, counted from grid north; a list by date is refused."""
    words = " ".join(words).split()
    if len(words) != 2 or words[1].lower() not in ("degree", "degrees", "deg", "grads", "grad", "minutes"):
        raise InputError(f"{where}: declination {' '.join(words)[:60]!r}: expected one angle with its unit")
    degrees = float(number_for_survex(where, words[0])) * _DEGREES[_UNITS[words[1].lower()]]
    return f"*declination {degrees - convergence_deg:.6f} degrees"


def flags_for_survex(where: str, words: tuple[str, ...]) -> str:
    """Return the words of `flags` that Survex has; `approximate` has no equivalent and is left out."""
    kept, negate = [], False
    for word in (word.lower() for word in words):
        if word == "not":
            negate = True
            continue
        if word in _FLAGS:
            kept += ["not", word] if negate else [word]
        elif word not in ("approx", "approximate"):
            raise InputError(f"{where}: flag {word[:40]!r} is not supported")
        negate = False
    return " ".join(kept)


def cs_for_survex(where: str, words: tuple[str, ...]) -> tuple[str, str]:
    """Return a coordinate system for `*cs`, and the metric one in which the result is wanted."""
    name = " ".join(words)
    upper = name.upper()
    if re.fullmatch(r"OSGB:[HNOST][A-HJ-Z]", upper):
        return upper, "EPSG:27700"
    if re.fullmatch(r"(EPSG|ESRI):\d{3,6}", upper) or upper in ("S-MERC", "JTSK", "IJTSK", "JTSK03", "IJTSK03"):
        return upper, upper if ":" in upper or upper == "S-MERC" else f"I{upper.removeprefix('I')}"
    utm = re.fullmatch(r"UTM(\d{1,2})([NS]?)", upper)
    if utm and 1 <= int(utm[1]) <= 60:
        return f"UTM{int(utm[1])}{utm[2] or 'N'}", f"UTM{int(utm[1])}{utm[2] or 'N'}"
    raise InputError(f"{where}: cs {name[:40]!r} is not supported; use EPSG, ESRI, UTM, OSGB, S-MERC or JTSK")
