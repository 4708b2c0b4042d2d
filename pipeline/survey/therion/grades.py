"""Grades of surveys: the deviations of readings that a name stands for."""

from __future__ import annotations

from pipeline.errors import InputError
from pipeline.survey.therion.lines import TherionLine
from pipeline.survey.therion.quantities import deviations

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
