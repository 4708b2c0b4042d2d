"""The columns of a station table by the names that total stations and surveyors' programs give them."""

from __future__ import annotations

import re
from pathlib import Path

from pipeline.errors import InputError
from pipeline.guard.reading_process import one_line, warn_user

_ALIKE = {  # our column, without its unit -> names of others, without theirs, in lower case
    "leg": ("drift", "strecke", "heading", "galerie", "galeria"),
    "station": ("punkt", "punktnummer", "punktnr", "punkt-nr", "pkt", "pktnr", "point", "point id", "pointid",
                "point_id", "point name", "point no", "point number", "pt", "ptid", "pt id", "stn", "punto", "numero",
                "nr", "nr.", "no", "no.", "number", "name", "id"),
    "easting": ("rechtswert", "ostwert", "ost", "east", "e", "este", "est", "rw"),
    "northing": ("hochwert", "nordwert", "nord", "north", "n", "norte", "hw"),
    "elevation": ("hoehe", "höhe", "elev", "elev.", "z", "rl", "alt", "altitude", "cota"),
    "left": ("links",), "right": ("rechts",), "up": ("oben",), "down": ("unten",),
}  # fmt: skip
_NAMES = ("leg", "station")  # of our columns, those without a unit
_UNIT = re.compile(r"\s*[\[(]\s*(m|ft|meter|metres?|feet)\s*\.?\s*[\])]$|_(m|ft)$")
_FEET = ("ft", "feet")
_LENGTHS = {"tape", "length", "distance", "dist", "laenge", "länge"}
_COMMENTS = 20  # lines above a table of shots, at most


def our_names(path: Path, names: list[str], needed: list[str]) -> list[str]:
    """Return the names of columns with ours in place of what others call them, and list what was replaced.

    Parameters
    ----------
    names : list of str
        As the table has them.
    needed : list of str
        Our columns without which there is no table; a column that has our name stands for itself.

    Returns
    -------
    list of str
        In lower case.

    Raises
    ------
    InputError
        If all is there but the column leg; the message says which columns are read as which.
    """
    shown, names = names, [name.lower() for name in names]
    found, read = list(names), dict[str, str]()
    for ours, alike in _ALIKE.items():
        if any(_parted(name)[0] == ours and _is_ours(name) for name in names):
            continue
        for k, name in enumerate(names):
            plain, unit = _parted(name)
            if plain in (ours, *alike) and found[k] == name:
                found[k] = ours if ours in _NAMES else f"{ours}_{'ft' if unit in _FEET else 'm'}"
                read[found[k]] = shown[k]
                break
    _require_legs(path, found, needed, read)
    if read:
        pairs = ", ".join(f"{one_line(name, 40)} as {ours}" for ours, name in read.items())
        warn_user(f"{path.name}: {len(read)} columns are read by the names that others use: {pairs}")
    return found


def _parted(name: str) -> tuple[str, str]:
    """Return a column's name without its unit, and the unit or nothing."""
    unit = _UNIT.search(name)
    return (name[: unit.start()].strip(), unit[1] or unit[2]) if unit else (name, "")


def _is_ours(name: str) -> bool:
    return name in _NAMES or name.endswith(("_m", "_ft"))


def _require_legs(path: Path, names: list[str], needed: list[str], read: dict[str, str]) -> None:
    """Refuse a list of points: it has all that a station table needs but the legs that points follow each other in."""
    if "leg" in names or not {column.replace("_ft", "_m") for column in names} >= set(needed) - {"leg"}:
        return
    known = [f"{one_line(name, 40)} is {ours}" for ours, name in read.items()]
    columns = f" ({', '.join(known)})" if known else ""
    raise InputError(
        f"{path}: a list of points{columns}, and which of them follow each other along a drift is not in it: add a "
        "column leg, the name of its drift in each row, with the rows in order along it, and left_m and right_m or "
        "--half-width M; of a scan save the coordinates alone, as .xyz"
    )


def require_no_shots(path: Path, text: str) -> None:
    """Refuse a table of shots from station to station, with the program that reads it.

    Raises
    ------
    InputError
        If the first line, or a comment above the rows, names from, to and a length.
    """
    for line in text.splitlines()[:_COMMENTS]:
        words = [word.strip("\"'# ").lower() for word in re.split(r"[,;\s]+", line)]
        if {"from", "to"} <= set(words) and _LENGTHS & set(words):
            if "topodroid" in text[:2000].lower():
                way = "TopoDroid exports the same survey for Survex or Therion: give the .svx or .th"
            else:
                way = (
                    "Survex reads them: in a file .svx write the line '*data normal from to tape compass clino' with "
                    "the order of these columns, and below it the rows with blanks between their fields"
                )
            raise InputError(f"{path}: a table of shots from station to station, not of stations with places; {way}")
