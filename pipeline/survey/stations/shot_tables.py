"""Tables of what an instrument read from station to station: refused, with the words in which Survex reads them."""

from __future__ import annotations

import re
from pathlib import Path

from pipeline.errors import InputError
from pipeline.guard.csv_text import separator_of
from pipeline.guard.reading_process import one_line
from pipeline.scans.table_columns import best_columns

_READINGS = {  # of Survex -> names of columns, in lower case without units
    "from": ("from", "von", "station from", "from station"),
    "to": ("to", "nach", "bis", "target", "ziel", "station to", "to station"),
    "tape": ("tape", "length", "distance", "dist", "laenge", "länge", "sd", "slope distance", "slopedist", "slope dist",
             "sdist", "slope_distance", "schrägstrecke", "schraegstrecke", "sdi"),
    "compass": ("compass", "azimuth", "bearing", "azi", "hz", "ha", "hzangle", "hz angle", "horizontal angle", "hcr",
                "har", "hangle", "horizontal_angle", "richtung"),
    "clino": ("clino", "inclination", "clinometer", "incl", "va", "vangle", "vertical angle"),
    "zenith": ("v", "zenith", "za", "zenith angle", "zenith_angle", "vz", "zenitwinkel"),
}  # fmt: skip
_UNIT = re.compile(r"\s*[\[(_](deg|degrees|gon|grad|grads|g|ft|feet|m|metres|meters)\s*[\])]?$")
_GRADS, _FEET = ("gon", "grad", "grads", "g"), ("ft", "feet")
_COMMENTS = 20  # lines above a table of shots, at most


def require_no_readings(path: Path, text: str) -> None:
    """Refuse a table of distances and angles, with the program that reads it.

    Raises
    ------
    InputError
        If the first line, or a comment above the rows, names a length and an angle or from and to. The message has the
        lines of Survex that read the rows.
    """
    for line in text.splitlines()[:_COMMENTS]:
        words = line.split(separator_of(line) if set(line) & set(",;\t") else None)
        words = [word.strip("\"'# ") for word in words]
        found = [_reading(word.lower()) for word in words if word]
        named = {name for name, _ in found}
        if {"from", "to", "tape"} <= named:
            raise InputError(
                f"{path}: a table of shots from station to station, not of stations with places; {_way(text, found)}"
            )
        if {"tape", "compass"} <= named and named & {"clino", "zenith"} and "easting" not in best_columns(words):
            raise InputError(
                f"{path}: its columns ({one_line(', '.join(words), 100)}) are distances and angles that a total "
                "station read, and no places: export coordinates, or add the columns from and to, the stations at both "
                "ends"
            )


def _reading(word: str) -> tuple[str, str]:
    """Return Survex's name of a column, or `ignore`, and its unit or nothing."""
    unit = _UNIT.search(word)
    plain = word[: unit.start()].strip() if unit else word
    name = next((name for name, alike in _READINGS.items() if plain in alike), "ignore")
    return name, unit[1] if unit else ""


def _way(text: str, found: list[tuple[str, str]]) -> str:
    if "topodroid" in text[:2000].lower():
        return "TopoDroid exports the same survey for Survex or Therion: give the .svx or .th"
    names = dict(found)
    lines = [
        *(f"*units {name} grads" for name in ("compass", "clino", "zenith") if names.get(name) in _GRADS),
        *(["*units tape feet"] if names.get("tape") in _FEET else []),
    ]
    quarter = 100 if names.get("zenith") in _GRADS else 90
    lines = [line.replace("zenith", "clino") for line in lines]
    lines += [f"*calibrate clino {quarter} -1"] if "zenith" in names else []  # a zenith angle of 90 deg is level
    order = " ".join("clino" if name == "zenith" else name for name, _ in found)
    lines.append(f"*data normal {order}")
    return (
        f"Survex reads them: in a file .svx write {', '.join(repr(line) for line in lines)}, each on a line of its "
        "own, and below them the rows with blanks between their fields; angles of the compass count from north"
    )
