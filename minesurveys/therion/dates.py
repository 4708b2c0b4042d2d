"""Dates of centrelines, of which Therion takes the middle, and the declinations that are stated for dates."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path

import numpy as np

from minesurveys.errors import InputError
from minesurveys.therion.lines import TherionLine
from minesurveys.therion.words import DEGREES, UNITS, number_for_survex

_DATE = re.compile(r"(1[89]\d\d|20\d\d)(?:\.(0?[1-9]|1[0-2])(?:\.(0?[1-9]|[12]\d|3[01]))?)?(?![\d.])")
CENTRELINES = ("centreline", "centerline")
Dates = dict[tuple[Path, int], str]
"""The date of each centreline that states one, by the file and the line where it begins, as Survex reads it."""


def dates_of(lines: list[TherionLine]) -> Dates:
    """Return the date of each centreline. A stated day stays as it is, also without its month or its day."""
    stated: dict[tuple[Path, int], list[str]] = {}
    current: list[str] | None = None
    for line in lines:
        if line.words[0] in CENTRELINES:
            current = stated.setdefault((line.path, line.number), [])
        elif line.words[0] == "date" and current is not None and len(line.words) > 1:
            current += [text for part in re.split(r"[@-]", line.words[1]) if (text := date_of(part))]
    return {key: _middle(texts) for key, texts in stated.items() if texts}


def year_of(text: str) -> float:
    """Return a date in years: without a month the middle of the year, without a day that of the month."""
    year, month, day = ([int(part) for part in text.split(".")] + [0, 0])[:3]
    if not month:
        return year + 0.5
    first = date(year, 1, 1)
    days = (date(year, month, 1) - first).days + ((day - 1) if day else 14) + 0.5
    return year + days / (date(year + 1, 1, 1) - first).days


def date_of(text: str) -> str:
    """Return a date, or nothing if it is none that Survex reads, such as a time of the day."""
    found = _DATE.fullmatch(text.strip())
    return ".".join(part for part in found.groups() if part) if found else ""


def _middle(texts: list[str]) -> str:
    first, last = min(texts, key=year_of), max(texts, key=year_of)
    if first == last:
        return first
    years = (year_of(first) + year_of(last)) / 2
    begin = date(int(years), 1, 1)
    days = (date(begin.year + 1, 1, 1) - begin).days
    return f"{begin + timedelta(days=int((years - begin.year) * days)):%Y.%m.%d}"


@dataclass(frozen=True)
class Declination:
    """Degrees by date (years), and for data without a date; None where the list states none for these."""

    years: tuple[float, ...]
    degrees: tuple[float, ...]
    undated: float | None = None

    def on(self, date: str) -> float:
        """Return the declination, deg, on a date, or for data without one where it is empty.

        It is linear between the dates of the list, and beyond them that of the nearest. Data without a date take what
        the list states for them, else its mean over time.
        """
        if date and self.years:
            return float(np.interp(year_of(date), self.years, self.degrees))
        if self.undated is not None:
            return self.undated
        if len(self.years) == 1:
            return self.degrees[0]
        return float(np.trapezoid(self.degrees, self.years) / (self.years[-1] - self.years[0]))

    @property
    def needs_date(self) -> bool:
        """Return whether its values differ, and none is stated for data without a date."""
        return self.undated is None and len(set(self.degrees)) > 1


def declination_of(where: str, words: list[str]) -> Declination:
    """Return what `VALUE UNIT` or `DATE VALUE DATE VALUE ... UNIT` states; `-` is the date of data without one.

    Raises
    ------
    InputError
        If an angle, a date or the unit is none.
    """
    words = " ".join(word.strip("[]") for word in words).split()
    unit = UNITS.get(words[-1].lower(), "") if words else ""
    values = words[:-1]
    if unit not in DEGREES or not values or (len(values) > 1 and len(values) % 2):
        raise InputError(
            f"{where}: declination {' '.join(words)[:60]!r}: expected one angle, or dates with angles, and a unit"
        )
    if len(values) == 1:
        return Declination((), (), float(number_for_survex(where, values[0])) * DEGREES[unit])
    dated, undated = {}, None
    for text, angle in zip(values[::2], values[1::2], strict=True):
        degrees = float(number_for_survex(where, angle)) * DEGREES[unit]
        date = date_of(text)
        if text == "-":
            undated = degrees
        elif not date:
            raise InputError(f"{where}: declination {text[:40]!r} is no date")
        else:
            dated[year_of(date)] = degrees
    years = sorted(dated)
    return Declination(tuple(years), tuple(dated[year] for year in years), undated)
