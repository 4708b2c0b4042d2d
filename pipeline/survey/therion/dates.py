"""Dates of centrelines: Therion takes the middle between the first and the last one that a centreline states."""

from __future__ import annotations

import re
from datetime import date, timedelta
from pathlib import Path

from pipeline.survey.therion.lines import TherionLine

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
