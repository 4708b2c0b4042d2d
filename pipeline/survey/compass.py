"""Reader of Compass plot files (.plt), the form in which Therion exports a centreline with its passages."""

from __future__ import annotations

import math
from pathlib import Path

from pipeline.errors import InputError
from pipeline.survey.legs import SurveyLeg, legs_of_chains
from pipeline.survey.shapes import read_text_bytes

_FOOT_M = 0.3048
_UNKNOWN_FT = 900.0  # Compass writes 999.9 or a negative distance where none was measured


def read_plt(path: Path) -> list[SurveyLeg]:
    """Read the legs of a plot file; a leg ends where the pen is lifted.

    Returns
    -------
    list of SurveyLeg
        Metres in the file's own frame, x east, y north; vertical legs are left out.

    Raises
    ------
    InputError
        Naming file, line and value.

    References
    ----------
    Compass, "Plot file format": `M` or `D` north east up `S`name `P` left up down right, in feet.
    """
    chains: list[list[tuple[str, tuple[float, float], tuple[float, float]]]] = []
    for number, line in enumerate(read_text_bytes(path).decode("latin-1").splitlines(), start=1):
        fields = line.split()
        if not fields or fields[0] not in ("M", "D"):
            continue
        name = next((f[1:] for f in fields[4:] if f.startswith("S")), "")
        if len(fields) < 5 or not name:
            raise InputError(f"{path}:{number}: want {fields[0]} north east up Sname, found {line[:60]!r}")
        north, east, _ = (_feet(path, number, text) for text in fields[1:4])
        sides = (math.nan, math.nan)
        if "P" in fields[4:]:
            at = fields.index("P", 4)
            widths = [_feet(path, number, text) for text in fields[at + 1 : at + 5]]
            if len(widths) < 4:
                raise InputError(f"{path}:{number}: want P left up down right, found {line[:60]!r}")
            sides = _side(widths[0]), _side(widths[3])
        if fields[0] == "M" or not chains:
            chains.append([])
        chains[-1].append((name, (east, north), sides))
    return legs_of_chains(path, chains)


def _feet(path: Path, number: int, text: str) -> float:
    try:
        value = float(text) * _FOOT_M
    except ValueError:
        raise InputError(f"{path}:{number}: {text[:40]!r} is not a number of feet") from None
    if not math.isfinite(value):
        raise InputError(f"{path}:{number}: {text[:40]!r} is not finite")
    return value


def _side(metres: float) -> float:
    return metres if 0 <= metres < _UNKNOWN_FT * _FOOT_M else math.nan
