"""Fixed stations: the places that `fix` states, their deviations, and the mean of several places of one station."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np

from minesurveys.errors import InputError
from minesurveys.remarks import warn_user
from minesurveys.survex.survex_text import SurvexText
from minesurveys.therion.lines import TherionLine
from minesurveys.therion.place import System
from minesurveys.therion.quantities import FixAxis
from minesurveys.therion.words import number_for_survex

_NOTHING = ";"
_EXACT_M = 1e-6  # places of one station that differ by less are one


@dataclass(frozen=True)
class _Fix:
    """One line of `fix`: where its command stands, the station's names, its place, and deviations (nan: exact)."""

    line: TherionLine
    at: int
    station: str
    cs: str
    place: np.ndarray
    deviations: np.ndarray


@dataclass
class Fixes:
    """The fixed stations of a project, by their whole names."""

    made: SurvexText
    found: dict[str, list[_Fix]] = field(default_factory=lambda: defaultdict(list))

    def add(
        self, line: TherionLine, station: str, prefix: str, system: System | None, axes: dict[str, FixAxis]
    ) -> None:
        """Add a line `fix station east north up`, and one, two or three deviations.

        One deviation is that of all coordinates; two are those of the plan and of the height. In a coordinate system,
        units and corrections are those of the height alone.

        Raises
        ------
        InputError
            If a number is none.
        """
        if len(line.words) < 5:
            raise InputError(f"{line.where}: expected fix station east north up")
        x, y, z, *rest = (float(number_for_survex(line.where, word)) for word in line.words[2:8])
        scales = np.array([1.0 if system else axes["x"].metres, 1.0 if system else axes["y"].metres, axes["z"].metres])
        east, north = system.east_north(x, y) if system else (axes["x"].read(x), axes["y"].read(y))
        place = np.array([east, north, axes["z"].read(z)])
        deviations = _deviations(rest) * scales
        fix = _Fix(line, len(self.made.lines), station, system.name if system else "", place, deviations)
        self.found[prefix + station].append(fix)
        self.made.add(line, _command(station, fix.place, fix.deviations))

    def combine(self) -> None:
        """Replace several places of one station by their mean, weighted by their deviations, and list it.

        Raises
        ------
        InputError
            If the places of a station are in two coordinate systems.
        """
        for fixes in self.found.values():
            if len(fixes) == 1:
                continue
            first = fixes[0]
            if len({fix.cs for fix in fixes}) > 1:
                raise InputError(
                    f"{fixes[1].line.where}: station {first.station[:60]} is fixed in two coordinate systems; state one"
                )
            place, deviations = _mean(fixes)
            for fix in fixes:
                self.made.lines[fix.at] = _NOTHING
            self.made.lines[first.at] = _command(first.station, place, deviations)
            apart = max(float(np.linalg.norm(fix.place - place)) for fix in fixes)
            if apart > _EXACT_M:
                warn_user(
                    f"places of station {first.station[:60]} are stated; their mean is taken, {apart:.4g} m from "
                    "the farthest",
                    of=first.line.path.name,
                    count=len(fixes),
                )


def _deviations(stated: list[float]) -> np.ndarray:
    """Return the deviations (3,) of a place; nan if it is exact, which a deviation of 0 says, too."""
    if not any(stated):
        return np.full(3, np.nan)
    return np.array([stated[0], *stated] if len(stated) == 2 else (stated * 3)[:3])


def _mean(fixes: list[_Fix]) -> tuple[np.ndarray, np.ndarray]:
    """Return the place of a station and its deviations; places that are exact count alone."""
    places, sd = np.array([fix.place for fix in fixes]), np.array([fix.deviations for fix in fixes])
    exact = np.isnan(sd).any(axis=1)
    if exact.any():
        return places[exact].mean(axis=0), np.full(3, np.nan)
    weights = sd**-2
    return (places * weights).sum(axis=0) / weights.sum(axis=0), weights.sum(axis=0) ** -0.5


def _command(station: str, place: np.ndarray, deviations: np.ndarray) -> str:
    numbers = [f"{value:.9f}".rstrip("0").rstrip(".") for value in place]
    if not np.isnan(deviations).any():
        numbers += [f"{value:.6g}" for value in deviations]
    return f"*fix {station} {' '.join(numbers)}"
