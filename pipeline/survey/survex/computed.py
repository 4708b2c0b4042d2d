"""Declinations that Survex computes: what it used, and a stated one in their place."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import pyproj

from pipeline.remarks import warn_user
from pipeline.survey.solved.model import SolvedSurvey
from pipeline.survey.survex.convergence import convergence_deg

_COMPUTED = re.compile(r"^.*?:\d+(?::\d+(?:-\d+)?)?: info: Declination: (-?[\d.]+)° @ (\d{4}-\d\d-\d\d)", re.MULTILINE)
# The first version of Survex with each model of the earth's field, its name, and the last year of its forecast.
_MODELS = (((1, 4, 13), "IGRF-14", 2030), ((1, 4, 0), "IGRF-13", 2025), ((1, 2, 25), "IGRF-12", 2020))
_OPTION = "--declination"
_AUTO = re.compile(rb"[ \t,]*\*[ \t,]*declination[ \t,]+auto\b", re.IGNORECASE)
_LINE_END = re.compile(rb"(\r\n|\n\r|\n|\r)")


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
