"""Reader of Compass plot files (.plt). Therion exports a centreline with passages in this format."""

from __future__ import annotations

import math
from pathlib import Path

from pipeline.errors import InputError
from pipeline.survey.legs import SurveyLeg, legs_of_chains
from pipeline.survey.plain_file import read_text_bytes, require_at_most

_FOOT_M = 0.3048
_UNKNOWN_FT = 900.0  # Compass writes 999.9 or a negative number for a distance that was not measured


def read_plt(path: Path) -> list[SurveyLeg]:
    """Read the legs of a plot file. A move (`M`) begins a new leg.

    Returns
    -------
    list of SurveyLeg
        Metres in the file's own frame, x east, y north. Vertical legs are omitted.

    Raises
    ------
    InputError
        If a line cannot be read. The message names the file, the line and the value.

    References
    ----------
    Compass, "Plot file format": `M` or `D` north east up `S`name `P` left up down right, in feet.
    """
    chains: list[list[tuple[str, tuple[float, float], tuple[float, float]]]] = []
    count = 0
    for number, line in enumerate(read_text_bytes(path).decode("latin-1").splitlines(), start=1):
        fields = line.split()
        if not fields or fields[0] not in ("M", "D"):
            continue
        name = next((f[1:] for f in fields[4:] if f.startswith("S")), "")
        if len(fields) < 5 or not name:
            raise InputError(f"{path}:{number}: expected {fields[0]} north east up Sname, got {line[:60]!r}")
        north, east, _ = (_feet(path, number, text) for text in fields[1:4])
        walls = (math.nan, math.nan)
        if "P" in fields[4:]:
            start = fields.index("P", 4) + 1
            widths = [_feet(path, number, text) for text in fields[start : start + 4]]
            if len(widths) < 4:
                raise InputError(f"{path}:{number}: expected P left up down right, got {line[:60]!r}")
            walls = _wall_m(widths[0]), _wall_m(widths[3])
        if fields[0] == "M" or not chains:
            chains.append([])
        chains[-1].append((name, (east, north), walls))
        count += 1
        require_at_most(path, count, "stations", "stations or more")
    return legs_of_chains(path, chains)


def _feet(path: Path, number: int, text: str) -> float:
    try:
        value = float(text) * _FOOT_M
    except ValueError:
        raise InputError(f"{path}:{number}: {text[:40]!r} is not a number of feet") from None
    if not math.isfinite(value):
        raise InputError(f"{path}:{number}: {text[:40]!r} is not finite")
    return value


def _wall_m(metres: float) -> float:
    """Return a wall distance, m; nan if it was not measured."""
    return metres if 0 <= metres < _UNKNOWN_FT * _FOOT_M else math.nan
