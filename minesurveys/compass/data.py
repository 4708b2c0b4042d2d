"""Compass survey data (.dat) and its closed form (.clp): surveys with their shots."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

from minesurveys.errors import InputError
from minesurveys.guard.plain_number import plain_number
from minesurveys.solved.project_files import text_lines

_FOOT_M = 0.3048
_NONE = 999.0
_UNKNOWN = 900.0  # Compass writes 999 or -999 for a reading that was not made; distances to walls are also below 0
_FARTHEST_FT = 1e6
_FIELD = re.compile(r"([A-Z]+2?):\s*")
_FLAGS = re.compile(r"#\|([A-Z]*)#")
_NO_DATE = date(1901, 1, 1)


@dataclass(frozen=True)
class CompassSurvey:
    """What the head of a survey states.

    Corrections are added to readings: bearing, inclination, their backsights, degrees, and length, feet.
    """

    date: str = ""
    declination_deg: float = 0.0
    bearing_deg: float = 0.0
    inclination_deg: float = 0.0
    back_bearing_deg: float = 0.0
    back_inclination_deg: float = 0.0
    length_ft: float = 0.0
    has_backsights: bool = False
    is_wall_at_end: bool = False  # passages are measured at a shot's second station
    path: Path = Path()
    number: int = 0


@dataclass(frozen=True)
class CompassShot:
    """A shot; readings that were not made are nan.

    `lrud_m` are the distances left, right, up and down. `flags` are Compass's letters.
    """

    path: Path
    number: int
    start: str
    end: str
    length_ft: float
    bearing_deg: float
    inclination_deg: float
    lrud_m: tuple[float, float, float, float]
    back_bearing_deg: float = math.nan
    back_inclination_deg: float = math.nan
    flags: str = ""


@dataclass
class _Head:
    """The lines of a survey before its shots."""

    fields: dict[str, str] = field(default_factory=dict)
    number: int = 0


def read_surveys(path: Path) -> Iterator[tuple[CompassSurvey, list[CompassShot]]]:
    """Yield the surveys of a file. A survey ends with a form feed; its shots follow the heading after DECLINATION.

    Raises
    ------
    InputError
        If a reading is not a number. The message names the file and the line.

    References
    ----------
    Compass, "Survey data file format": FROM TO LENGTH BEARING INC LEFT UP DOWN RIGHT, backsights of a survey that has
    them, and #|flags#; feet and degrees, whatever the units in which FORMAT says that they were read.
    """
    head = _Head()
    survey: CompassSurvey | None = None
    shots: list[CompassShot] = []
    for number, line in text_lines(path):
        if "\f" in line:
            if survey is not None:
                yield survey, shots
            head, survey, shots = _Head(), None, []
        elif survey is None and (line.split()[:2] == ["FROM", "TO"] or (head.number and line.strip())):
            survey = _survey(path, head)
        elif survey is None:
            _read_head(head, number, line)
        elif line.strip("\x1a\0 \t"):
            shots.append(_shot(path, number, line, survey.has_backsights))
    if survey is not None:
        yield survey, shots


def _read_head(head: _Head, number: int, line: str) -> None:
    line = line.strip()
    if line.startswith("SURVEY DATE"):
        head.fields["DATE"] = line.partition(":")[2].partition("COMMENT:")[0]
    elif line.startswith("DECLINATION"):
        head.number = number
        parts = _FIELD.split(line)
        head.fields |= dict(zip(parts[1::2], parts[2::2], strict=True))


def _survey(path: Path, head: _Head) -> CompassSurvey:
    is_closed = path.suffix.lower() == ".clp"  # its readings are corrected already
    where = f"{path}:{head.number}"
    first = [] if is_closed else _numbers(where, head.fields.get("CORRECTIONS", ""), 3)
    bearing, inclination, length = [*first, 0.0, 0.0, 0.0][:3]
    second = [] if is_closed else _numbers(where, head.fields.get("CORRECTIONS2", ""), 2)
    back_bearing, back_inclination = second if len(second) == 2 else (bearing, inclination)
    layout = (head.fields.get("FORMAT", "").split() or [""])[0]
    size = len(layout)
    backsights = layout[13 if size >= 15 else 11] if size >= 12 else ""
    declination = _numbers(where, head.fields.get("DECLINATION", ""), 1)
    return CompassSurvey(
        _date(head.fields.get("DATE", "")),
        declination[0] if declination else 0.0,
        bearing,
        inclination,
        back_bearing,
        back_inclination,
        length,
        backsights in ("B", "C"),
        size in (13, 15) and layout.endswith("T"),
        path,
        head.number,
    )


def _date(text: str) -> str:
    """Return a date for Survex, or nothing. Compass writes month, day and year, and 1 1 1901 if none was stated."""
    words = text.split()[:3]
    if len(words) < 3 or not all(word.isascii() and word.isdigit() for word in words):
        return ""
    month, day, year = (int(word[:4]) for word in words)
    try:
        found = date(year + 1900 if year < 100 else year, month, day)
    except ValueError:
        return ""
    return "" if found == _NO_DATE or not 1900 <= found.year < 2078 else f"{found:%Y.%m.%d}"


def _shot(path: Path, number: int, line: str, has_backsights: bool) -> CompassShot:
    where, words = f"{path}:{number}", line.split()
    count = 11 if has_backsights else 9
    if len(words) < count:
        raise InputError(f"{where}: {line.strip()[:60]!r}: want two stations and {count - 2} readings")
    start, end, *texts = words[:count]
    length, bearing, inclination, left, up, down, right, *back = (_reading(where, text) for text in texts)
    if not 0 <= length <= _FARTHEST_FT:
        raise InputError(f"{where}: a shot of {texts[0][:40]} feet, which is no length")
    walls = [wall * _FOOT_M if 0 <= wall < _UNKNOWN else math.nan for wall in (left, right, up, down)]
    angles = [math.nan if abs(angle) >= _UNKNOWN else angle for angle in (bearing, inclination, *back, *2 * [_NONE])]
    found = _FLAGS.search(line)
    return CompassShot(
        path,
        number,
        start,
        end,
        length,
        angles[0],
        angles[1],
        (walls[0], walls[1], walls[2], walls[3]),
        angles[2],
        angles[3],
        found[1] if found else "",
    )


def _numbers(where: str, text: str, count: int) -> list[float]:
    """Return as many numbers as stand at the beginning of a text, at most `count`."""
    words = text.split()[:count]
    return [_reading(where, word) for word in words]


def _reading(where: str, text: str) -> float:
    try:
        value = plain_number(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where}: {text[:40]!r} is not a number")
    return value
