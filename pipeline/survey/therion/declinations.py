"""Stated declinations: one angle, or a list by date as the option of a survey may have it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.survey.therion.dates import date_of, year_of
from pipeline.survey.therion.words import DEGREES, UNITS, number_for_survex


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
