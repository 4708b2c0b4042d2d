"""Reader of Compass plot files (.plt). Therion exports a centreline with passages in this format."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import read_text_bytes, require_at_most
from minesurveys.guard.plain_number import plain_number
from minesurveys.solved.model import LegFlag, LegStyle, Passage, SolvedSurvey, StationFlag

_FOOT_M = 0.3048
_FARTHEST_M = 1e8
_HPGL = re.compile(r"\s*(?:\x1b\S*\s*)?(?:IN|SP\d*|PU|DF|BP)\s*[;,\d]")  # how files for plotters begin
_SPLAY_ENDS = (".", "-", "")  # names of the ends of splays: Therion writes the first two, Survex none
_FLAGS = {"L": LegFlag.DUPLICATE, "P": LegFlag.SURFACE, "S": LegFlag.SPLAY}  # of shots, as in Compass's survey data
_UNKNOWN_FT = 900.0  # Compass writes 999.9 or a negative number for a distance that was not measured
# Name, place east, north and up, and distances left, right, up and down, m; nan: not measured.
_Place = tuple[float, float, float]
_Station = tuple[str, _Place, list[float]]


def read_plt(path: Path) -> SolvedSurvey:
    """Read the legs of a plot file. A move (`M`) begins a new leg; a shot with a flag is no leg of a passage.

    Returns
    -------
    SolvedSurvey
        Metres in the file's own frame, x east, y north.

    Raises
    ------
    InputError
        If a line cannot be read. The message names the file, the line and the value.

    References
    ----------
    Compass, "Plot file format": `M` or `D` north east up `S`name `P` left up down right, in feet, and `F`flags of the
    shot. Survex 1.4.22 writes the flags, and reads `d` as a shot that is not plotted.
    """
    chains: list[list[_Station]] = []
    splays: list[tuple[_Place, _Place]] = []  # their stations, and their ends
    flagged: list[tuple[_Place, _Place, LegFlag]] = []  # other shots with flags
    count = 0
    text = read_text_bytes(path).decode("latin-1")
    if _HPGL.match(text):
        raise InputError(f"{path}: a file for plotters (HPGL), none of Compass; save the drawing as .dxf or .pdf")
    for number, line in enumerate(text.splitlines(), start=1):
        fields = line.split()
        if not fields or fields[0] not in ("M", "D", "d"):
            continue
        name = next((f[1:] for f in fields[4:] if f.startswith("S")), None)
        if len(fields) < 5 or name is None:
            raise InputError(f"{path}:{number}: expected {fields[0]} north east up Sname, got {line[:60]!r}")
        north, east, high = (_feet(path, number, text) for text in fields[1:4])
        walls = [math.nan] * 4
        if "P" in fields[4:]:
            start = fields.index("P", 4) + 1
            widths = [_feet(path, number, text) for text in fields[start : start + 4]]
            if len(widths) < 4:
                raise InputError(f"{path}:{number}: expected P left up down right, got {line[:60]!r}")
            left, up, down, right = (width if 0 <= width < _UNKNOWN_FT * _FOOT_M else math.nan for width in widths)
            walls = [left, right, up, down]
        letters = next((f[1:] for f in fields[5:] if f.startswith("F")), "") + ("P" if fields[0] == "d" else "")
        flag = sum((_FLAGS.get(letter, LegFlag(0)) for letter in set(letters)), LegFlag(0))
        place = (east, north, high)
        if fields[0] == "M" or not chains:
            chains.append([])
        elif flag and name not in _SPLAY_ENDS and chains[-1]:
            flagged.append((chains[-1][-1][1], place, flag))
            chains.append([])
        if name not in _SPLAY_ENDS:
            chains[-1].append((name, place, walls))
        elif chains[-1]:
            splays.append((chains[-1][-1][1], place))
        count += 1
        require_at_most(path, count, "stations", "stations or more")
    chains = [chain for chain in chains if chain]
    if not any(len(chain) > 1 for chain in chains):
        raise InputError(f"{path}: no legs: no line D with a station follows another line M or D with one")
    return _survey_of(path, chains, splays, flagged)


def _survey_of(
    path: Path,
    chains: list[list[_Station]],
    splays: list[tuple[_Place, _Place]],
    flagged: list[tuple[_Place, _Place, LegFlag]],
) -> SolvedSurvey:
    """Return the chains as a survey in three dimensions; equal names at different places get numbers."""
    number: dict[_Place, int] = {}
    names: dict[str, None] = {}
    for name, place, _ in (station for chain in chains for station in chain):
        if place not in number:
            number[place] = len(number)
            names[name if name not in names else f"{name} ({len(names)})"] = None
    rows = [np.array([number[place] for _, place, _ in chain]) for chain in chains]
    others = np.array([[number[start], number[end]] for start, end, _ in flagged], np.int64).reshape(-1, 2)
    legs = np.concatenate([*(np.column_stack([row[:-1], row[1:]]) for row in rows), others])
    has_splays = bool(splays) or any(flag & LegFlag.SPLAY for *_, flag in flagged)
    passages = [
        Passage(row, np.array([walls for *_, walls in chain], float))
        for row, chain in zip(rows, chains, strict=True)
        if len(row) > 1 and not (has_splays and np.isnan([walls for *_, walls in chain]).all())  # its walls are splays'
    ]
    ends = np.arange(len(number), len(number) + len(splays))
    from_stations = np.array([[number[start], end] for (start, _), end in zip(splays, ends, strict=True)])
    places = np.array([*number, *(end for _, end in splays)])
    station_flags = np.full(len(places), StationFlag.UNDERGROUND, np.uint8)
    station_flags[ends] = StationFlag.ANONYMOUS
    flags = np.zeros(len(legs) + len(splays), np.uint8)
    flags[len(legs) - len(flagged) : len(legs)] = [flag for *_, flag in flagged]
    flags[len(legs) :] = LegFlag.SPLAY
    legs = np.concatenate([legs, from_stations]) if splays else legs
    styles = np.full(len(legs), LegStyle.UNKNOWN, np.uint8)
    every_name = (*names, *[""] * len(splays))
    return SolvedSurvey(every_name, places, station_flags, legs, flags, styles, tuple(passages), path.stem)


def _feet(path: Path, number: int, text: str) -> float:
    try:
        value = plain_number(text) * _FOOT_M
    except ValueError:
        raise InputError(f"{path}:{number}: {text[:40]!r} is not a number of feet") from None
    if not abs(value) <= _FARTHEST_M:
        raise InputError(f"{path}:{number}: {text[:40]!r} is not a finite number of feet below {_FARTHEST_M:g} m")
    return value
