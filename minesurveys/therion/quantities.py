"""Units, corrections and deviations of the quantities in a centreline, also by grade, as Survex's commands."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from minesurveys.errors import InputError
from minesurveys.therion.lines import TherionLine
from minesurveys.therion.words import QUANTITIES, SMALL, UNITS, number_for_survex

_METRES = {"metres": 1.0, "feet": 0.3048, "yards": 0.9144}
_AXES = ("x", "y", "z")
_SILENT = {*_AXES, "declination"}  # Survex has none of these: places are converted here, declinations have a unit
# Metres, degrees of the compass, and degrees of the clino, as Therion 6.1.6 hands its own grades to Survex.
_KNOWN = {
    "BCRA3": (0.25, 1.25, 1.25),
    "BCRA5": (0.05, 0.5, 0.5),
    "UISv1_3": (0.25, 2.5, 15.0),
    "UISv1_4": (0.05, 1.0, 1.0),
    "UISv1_5": (0.025, 0.5, 0.5),
    "UISv1_6": (0.01, 0.125, 0.125),
}
_WITHOUT = ("UISv1_-1", "UISv1_0", "UISv1_1", "UISv1_2", "UISv1_X")
_DEFAULT = "*sd default"
Grades = dict[str, list[str]]
"""Survex's commands for the deviations of each grade, by its name."""


@dataclass(frozen=True)
class FixAxis:
    """How a coordinate of `fix` is read: metres of its unit, and the error and the scale of `calibrate`."""

    metres: float = 1.0
    zero: float = 0.0
    scale: float = 1.0

    def read(self, value: float) -> float:
        """Return a coordinate in metres."""
        return (value - self.zero) * self.scale * self.metres


@dataclass
class Quantities:
    """What a centreline or an open group states of each quantity.

    A unit without a factor keeps the factor that the quantity had. Survex takes a correction in the units at its line,
    Therion in those of the readings, so corrections are stated again after units.
    """

    factors: dict[str, float] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    corrections: dict[str, str] = field(default_factory=dict)
    axes: dict[str, FixAxis] = field(default_factory=lambda: dict.fromkeys(_AXES, FixAxis()))

    def copy(self) -> Quantities:
        """Return them as they are, for a group."""
        return Quantities(dict(self.factors), dict(self.units), dict(self.corrections), dict(self.axes))

    def state_units(self, where: str, words: tuple[str, ...]) -> list[str]:
        """Read the words of `units`: quantities, an optional factor, and a unit. Return Survex's commands."""
        names, rest = _split(where, "units", words)
        unit, small = _unit(where, "units", words, rest)
        if len(rest) == 2:
            self.factors |= dict.fromkeys(names, float(number_for_survex(where, rest[0])))
        commands = []
        for name in names:
            factor = self.factors.get(name, 1.0) * small
            if name in _AXES:
                if unit not in _METRES:
                    raise InputError(f"{where}: units {' '.join(words)[:60]!r}: no unit of a length")
                self.axes[name] = replace(self.axes[name], metres=factor * _METRES[unit])
            elif name not in _SILENT:
                self.units[name] = unit
                commands.append(f"*units {name} {'' if factor == 1.0 else f'{factor:.10g} '}{unit}")
        return commands + self._corrected()

    def calibrate(self, where: str, words: tuple[str, ...]) -> list[str]:
        """Read the words of `calibrate`: quantities, the zero error, and an optional scale."""
        names, rest = _split(where, "calibrate", words)
        numbers = [number_for_survex(where, word) for word in rest]
        if len(numbers) not in (1, 2) or "declination" in names:
            raise InputError(f"{where}: calibrate {' '.join(words)[:60]!r} is not supported")
        zero, scale = (*map(float, numbers), 1.0)[:2]
        for name in names:
            if name in _AXES:
                self.axes[name] = replace(self.axes[name], zero=zero, scale=scale)
            else:
                self.corrections[name] = " ".join(numbers)
        return self._corrected()

    def metres(self, name: str, value: float) -> float:
        """Return a reading of a length in metres, with its correction."""
        zero, scale = ([float(text) for text in self.corrections.get(name, "0").split()] + [1.0])[:2]
        return (value - zero) * scale * self.factors.get(name, 1.0) * _METRES[self.units.get(name, "metres")]

    def _corrected(self) -> list[str]:
        return [f"*calibrate {name} {numbers}" for name, numbers in self.corrections.items()]


def deviations(where: str, words: tuple[str, ...]) -> list[str]:
    """Return Survex's commands for the words of `sd`. Those of places are left out: a `fix` states its own."""
    names, rest = _split(where, "sd", words)
    unit, small = _unit(where, "sd", words, rest)
    value = (float(number_for_survex(where, rest[0])) if len(rest) == 2 else 1.0) * small
    return [f"*sd {name} {value:.10g} {unit}" for name in names if name not in _SILENT]


def _split(where: str, what: str, words: tuple[str, ...]) -> tuple[list[str], list[str]]:
    """Return the quantities that words begin with, as Survex calls them, and the words after them."""
    count = next((i for i, word in enumerate(words) if word.lower() not in QUANTITIES), len(words))
    rest = [word.lower() for word in words[count:]]
    if rest and rest[0].startswith("back"):
        instrument = rest[0].removeprefix("back")[:20]
        raise InputError(f"{where}: {rest[0][:40]!r}: Therion has none of backsights; state those of {instrument!r}")
    if not count:
        raise InputError(f"{where}: {what} {' '.join(words)[:60]!r} are not supported")
    return [name for word in words[:count] for name in QUANTITIES[word.lower()].split()], rest


def _unit(where: str, what: str, words: tuple[str, ...], rest: list[str]) -> tuple[str, float]:
    """Return the unit at the end of some words as Survex calls it, and how many of these it is."""
    unit = rest[-1] if rest else ""
    if len(rest) not in (1, 2) or unit not in {**UNITS, **SMALL}:
        raise InputError(f"{where}: {what} {' '.join(words)[:60]!r} are not supported")
    return (UNITS[unit], 1.0) if unit in UNITS else ("metres", SMALL[unit])


def grades_of(lines: list[TherionLine]) -> Grades:
    """Return Therion's own grades and those that a project defines: between `grade NAME` and `endgrade`.

    Raises
    ------
    InputError
        If a line of a definition is none of a quantity, a number and a unit.
    """
    found: Grades = {name: [] for name in _WITHOUT}
    for name, (length, compass, clino) in _KNOWN.items():
        found[name] = [
            _DEFAULT,
            f"*sd length {length} metres",
            f"*sd compass {compass} degrees",
            f"*sd clino {clino} degrees",
        ]
    current: list[str] | None = None
    is_centreline = False
    for line in lines:
        word = line.words[0]
        if word in ("centreline", "centerline", "endcentreline", "endcenterline"):
            is_centreline = not word.startswith("end")
        elif word == "endgrade":
            current = None
        elif current is not None:
            current += deviations(line.where, line.words)
        elif word == "grade" and not is_centreline:
            if len(line.words) < 2:
                raise InputError(f"{line.where}: a grade without a name")
            current = found[line.words[1]] = [_DEFAULT]
    return found
