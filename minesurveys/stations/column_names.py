"""The columns of a station table: those that are stated, and those by the names that others give them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from minesurveys.clouds.table_columns import NAMES, QUANTITIES, best_columns, named_column
from minesurveys.errors import InputError, one_line
from minesurveys.guard.csv_text import separator_of
from minesurveys.guard.plain_number import plain_number
from minesurveys.remarks import warn_user

_SHOWN = 40
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


@dataclass(frozen=True)
class TableColumn:
    """A column: `name` is ours, in metres, or the file's own if it is not read; `metres` are those of its unit."""

    name: str
    metres: float = 1.0


def has_names(names: list[str]) -> bool:
    """Return whether a first line names columns: in a row of a table two fields or more are numbers."""
    return sum(map(_is_number, names)) < 2


def columns_of(
    path: Path, names: list[str], needed: list[str], stated: Mapping[str, str] | None = None
) -> list[TableColumn]:
    """Return the columns of a table, and list those that are read by a name that is not ours.

    Parameters
    ----------
    names : list of str
        As the table has them; of one without names the numbers of its columns.
    needed : list of str
        Our columns without which there is no table.
    stated : mapping of str to str, optional
        Our column, with its unit or without, and the name of the table's column that is it.

    Raises
    ------
    InputError
        If what is stated is not there, a unit is not known, or all is there but the column leg; the message says which
        columns are read as which.
    """
    found = [TableColumn(name.lower()) for name in names]
    given = _stated_columns(path, names, stated or {})
    for ours, (k, metres) in given.items():
        found = [TableColumn(f"{name.name} (not read)") if name.name == ours else name for name in found]
        found[k] = TableColumn(ours, metres)
    read: dict[str, str] = {}
    for quantity, k in best_columns(names).items():
        column = named_column(names[k])
        ours = quantity if quantity in NAMES else f"{quantity}_m"
        if ours in given or k in [other for other, _ in given.values()]:
            continue
        if quantity in NAMES:
            found[k] = TableColumn(ours)
        elif column.metres is None:
            raise InputError(
                f"{path}: the unit of the column {one_line(names[k], _SHOWN)!r} is not known (there are m, cm, mm, ft, "
                f"usft, in): --columns {quantity}_m={one_line(names[k], _SHOWN)!r} reads it as metres"
            )
        else:
            found[k] = TableColumn(ours, column.metres)
        if column.rank or not (quantity in NAMES or names[k].lower().startswith(f"{quantity}_")):
            read[ours if column.metres == 1.0 or quantity in NAMES else f"{quantity}_{column.unit}"] = names[k]
    _require_legs(path, found, needed, read)
    if read:
        pairs = ", ".join(f"{one_line(name, _SHOWN)} as {ours}" for ours, name in read.items())
        warn_user(
            f"columns are read by the names that others use: {pairs}",
            of=path.name,
            count=len(read),
            option="--columns",
            advice="--columns OURS=NAME,...",
        )
    return found


def _stated_columns(path: Path, names: list[str], stated: Mapping[str, str]) -> dict[str, tuple[int, float]]:
    """Return the number and the metres of the table's columns that are stated, by our names in metres."""
    found: dict[str, tuple[int, float]] = {}
    known = {name.lower(): k for k, name in reversed(list(enumerate(names)))}
    for ours, theirs in stated.items():
        column, place = named_column(ours), known.get(theirs.strip().lower())
        if column.quantity is None or column.rank or column.metres is None:
            raise InputError(
                f"{path}: --columns {one_line(ours, _SHOWN)}: no column of a station table; there are "
                f"{', '.join(QUANTITIES)}, all but {' and '.join(NAMES)} with a unit (_m, _cm, _mm, _ft, _usft, _in)"
            )
        if place is None:
            raise InputError(
                f"{path}: --columns {one_line(ours, _SHOWN)}={one_line(theirs, _SHOWN)}: no such column; there are "
                f"{one_line(', '.join(names), 200)}"
            )
        name = column.quantity if column.quantity in NAMES else f"{column.quantity}_m"
        if name in found or place in [k for k, _ in found.values()]:
            raise InputError(f"{path}: --columns {one_line(ours, _SHOWN)}={one_line(theirs, _SHOWN)}: stated twice")
        metres = column.metres if column.unit else named_column(names[place]).metres or 1.0
        found[name] = place, metres
    return found


def _is_number(text: str) -> bool:
    try:
        plain_number(text)
    except ValueError:
        return False
    return True


def _require_legs(path: Path, columns: list[TableColumn], needed: list[str], read: dict[str, str]) -> None:
    """Refuse a list of points: it has all that a station table needs but the legs that points follow each other in."""
    names = [column.name for column in columns]
    if "leg" in names or not set(names) >= set(needed) - {"leg"}:
        return
    known = [f"{one_line(name, _SHOWN)} is {ours}" for ours, name in read.items()]
    shown = f" ({', '.join(known)})" if known else ""
    other = next((name for name in names if name and named_column(name).quantity is None and not _is_ours(name)), None)
    by_option = "" if other is None else f", or --columns leg={one_line(other, _SHOWN)!r} if that one names it"
    raise InputError(
        f"{path}: a list of points{shown}, and which of them follow each other along a drift is not in it: add a "
        f"column leg, the name of its drift in each row, with the rows in order along it{by_option}, and left_m and "
        "right_m or --half-width M; of a scan save the coordinates alone, as .xyz"
    )


def _is_ours(name: str) -> bool:
    return named_column(name).quantity is not None or name == "rise_over_run"


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
        "own, and below them the rows with blanks between their fields, '-' for an empty reading and '..' for an empty "
        "station; angles of the compass count from north"
    )
