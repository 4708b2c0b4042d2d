"""What `cavern` says of its adjustment: misclosures, the length that it prints, and declinations that it computed."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyproj

from minesurveys.errors import InputError, one_line
from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.remarks import warn_user
from minesurveys.solved.model import LegStyle, SolvedSurvey
from minesurveys.survex.convergence import convergence_deg

_FIGURES = re.compile(r"Original length\s+([\d.]+)m \(.*?\), moved\s+([\d.]+)m \(.*?\)\. Error\s+([\d.]+)%")
_FIXED = "<fixed point>"  # the stated place of a fix with deviations
_JOINTS = re.compile(r" [-=] ")
_TOTAL = re.compile(r"^Total length of survey legs =\s*[\d.]+m \(\s*([\d.]+)m adjusted\)", re.MULTILINE)
_LEAST_M = 0.01  # a misclosure below the resolution of a `.3d` file is none
_GROSS = 3.0  # times what the deviations of the readings allow, of three coordinates: chance gives 1 in 100,000
_LISTED, _ENDS = 3, 4  # traverses, and stations at the beginning of a long one
# A leg's ends are whole centimetres in a `.3d` file: its length is off by 4 mm (root mean square). Ten times that.
_ROUNDING_M, _A_LEG_M = 0.02, 0.04
_COMPUTED = re.compile(r"^.*?:\d+(?::\d+(?:-\d+)?)?: info: Declination: (-?[\d.]+)° @ (\d{4}-\d\d-\d\d)", re.MULTILINE)
# The first version of Survex with each model of the earth's field, its name, and the last year of its forecast.
_MODELS = (((1, 4, 13), "IGRF-14", 2030), ((1, 4, 0), "IGRF-13", 2025), ((1, 2, 25), "IGRF-12", 2020))
_OPTION = "--declination"
_AUTO = re.compile(rb"[ \t,]*\*[ \t,]*declination[ \t,]+auto\b", re.IGNORECASE)
_LINE_END = re.compile(rb"(\r\n|\n\r|\n|\r)")


@dataclass(frozen=True)
class Traverse:
    """Legs in a row between junctions or fixed stations: names, length and misclosure, m, and its size.

    `times` is the misclosure over what the deviations of the readings allow.
    """

    stations: tuple[str, ...]
    length_m: float
    moved_m: float
    per_cent: float
    times: float


def read_traverses(path: Path) -> list[Traverse]:
    """Return the traverses of an `.err` file, which `cavern` writes; none if there is no such file."""
    if not path.is_file():
        return []
    found = []
    for block in read_text_bytes(path).decode("utf-8", "replace").split("\n\n"):
        lines = block.strip().splitlines()
        figures = _FIGURES.match(lines[1]) if len(lines) > 2 else None
        if figures is not None:
            length, moved, per_cent = map(float, figures.groups())
            found.append(Traverse(tuple(_JOINTS.split(lines[0])), length, moved, per_cent, float(lines[2])))
    return found


def warn_of_misclosures(path: Path, traverses: list[Traverse], name: Callable[[str], str]) -> str:
    """List the worst misclosures. `name` returns a station's name as the user wrote it.

    If readings are worse than their deviations allow, those that are worst in this way; else the longest one. Returns
    what the worst of them says, empty if all readings are as good as their deviations.
    """
    missed = [one for one in traverses if one.moved_m >= _LEAST_M]
    gross = sorted((one for one in missed if one.times > _GROSS), key=lambda one: -one.times)
    misses = []
    for one in gross[:_LISTED] or sorted(missed, key=lambda one: -one.moved_m)[:1]:
        kind = "loop" if one.stations[0] == one.stations[-1] != _FIXED else "traverse"
        size = f"by {one.moved_m:.2f} m in {one.length_m:.1f} m ({one.per_cent:.1f} %)"
        cause = f", {one.times:.0f} times what its readings allow: look for a wrong one" if one.times > _GROSS else ""
        misses.append(f"the {kind} {_named(one, name)} misses {size}{cause}")
        warn_user(misses[-1], of=path.name)
    if len(gross) > _LISTED:
        warn_user(
            f"more traverses miss by over {_GROSS:g} times what is allowed", of=path.name, count=len(gross) - _LISTED
        )
    return misses[0] if gross else ""


def _named(one: Traverse, name: Callable[[str], str]) -> str:
    names = [one_line(name(station), 40) for station in one.stations]
    if len(names) > 2 * _ENDS:
        names = [*names[:_ENDS], f"... ({len(names)} stations) ...", names[-1]]
    return " - ".join(names)


def require_printed_length(path: Path, output: str, survey: SolvedSurvey) -> None:
    """Refuse a result whose legs are not as long as `cavern` prints.

    Raises
    ------
    InputError
        If they differ by more than what whole centimetres explain.
    """
    found = _TOTAL.search(output)
    if found is None:
        return
    measured = survey.leg_styles[survey.centreline()] != LegStyle.NOSURVEY
    legs = survey.legs[survey.centreline()][measured]
    ours = float(np.linalg.norm(np.diff(survey.positions_m[legs], axis=1)[:, 0], axis=1).sum())
    printed, most = float(found[1]), _ROUNDING_M + _A_LEG_M * float(np.sqrt(len(legs)))
    if abs(ours - printed) > most:
        raise InputError(
            f"{path}: Survex prints {printed:.2f} m of legs, and its result has {ours:.2f} m; state fixes "
            "without deviations"
        )


@dataclass(frozen=True)
class Computed:
    """A declination that Survex computed, deg, and its date."""

    degrees: float
    date: str


def computed_declinations(output: str) -> list[Computed]:
    """Return the declinations that `cavern` prints."""
    return [Computed(float(degrees), date) for degrees, date in _COMPUTED.findall(output)]


def warn_of_computed(path: Path, version: tuple[int, ...], found: list[Computed]) -> None:
    """List the model, the dates and the values of computed declinations, and dates after the model's last year."""
    if not found:
        return
    known = next(((name, year) for first, name, year in _MODELS if version >= first), None)
    model, last = known or ("IGRF", None)
    ordered = sorted(found, key=lambda one: one.date)
    values = [f"{one.degrees:.1f} deg on {one.date}" for one in (ordered[0], ordered[-1])]
    text = " to ".join(dict.fromkeys(values))
    by = f"Survex {'.'.join(map(str, version))}"
    warn_user(f"declinations are computed by {model} of {by}: {text}", of=path.name, option=_OPTION)
    beyond = {one.date for one in ordered if last is not None and int(one.date[:4]) >= last}
    if beyond:
        off = "in 2026 IGRF-13 is 0.2 deg off in central Europe, 4 m a km"
        warn_user(
            f"dates are after the last year of {model}, {last}; {off}",
            of=path.name,
            count=len(beyond),
            option=_OPTION,
        )


def state_declination(declination_deg: float, survey: SolvedSurvey, files: list[Path]) -> None:
    """Write a declination in place of computed ones into files, all of which lie there for Survex alone.

    It is less the convergence of the meridians in the middle of the survey, which Survex counts for computed ones only.
    """
    east, north = survey.positions_m[:, :2].mean(axis=0).tolist()
    degrees = declination_deg - convergence_deg(pyproj.CRS.from_user_input(survey.crs), east, north)
    for file in files:
        if file.suffix in (".3d", ".err"):
            continue
        parts = _LINE_END.split(file.read_bytes())  # lines, and what ends each
        for number, line in enumerate(parts[::2]):
            if _AUTO.match(line):
                parts[2 * number] = f"*declination {degrees:.6f} degrees".encode()
        file.write_bytes(b"".join(parts))
