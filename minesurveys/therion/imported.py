"""Solved surveys (`.3d`) that a Therion project imports, as Survex data: their stations are fixed where they are."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from pathlib import Path

import numpy as np

from minesurveys.errors import InputError
from minesurveys.guard.plain_number import plain_number
from minesurveys.solved.model import LegFlag, SolvedSurvey
from minesurveys.solved.survex_3d import read_3d
from minesurveys.survex.survex_text import SurvexText, written_name, written_survey
from minesurveys.therion.lines import TherionLine, named_file
from minesurveys.therion.place import cs_for_survex

_SURVEYS = ("create", "use", "ignore")
_FLAGS = {LegFlag.SURFACE: "surface", LegFlag.DUPLICATE: "duplicate", LegFlag.SPLAY: "splay"}


@dataclass(frozen=True)
class _Options:
    """What an `import` line states: how surveys are named, whose stations are taken, and where they are moved."""

    surveys: str = "create"
    filter: str = ""
    moved_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    cs: str = ""


@dataclass
class Imports:
    """Where imported files are added: the project's folder, and the stations that were imported before.

    `has_place` is whether the project has a coordinate system; a file's own is named then. `surveys` are the project's
    surveys, those of files with `-surveys create` among them, as Survex reads them, each with a point at its end.
    """

    made: SurvexText
    folder: Path
    has_place: bool
    surveys: set[str]
    fixed: set[str] = field(default_factory=set)


def declared_surveys(lines: list[TherionLine]) -> set[str]:
    """Return the surveys that a project's lines declare, as Survex reads them, each with a point at its end."""
    open_surveys, found = [""], set()
    for line in lines:
        if line.words[0] == "survey" and len(line.words) > 1:
            is_named = ("-namespace", "off") not in pairwise(line.words)
            open_surveys.append(open_surveys[-1] + (f"{written_survey(line.words[1])}." if is_named else ""))
            found.add(open_surveys[-1])
        elif line.words[0] == "endsurvey" and len(open_surveys) > 1:
            open_surveys.pop()
    return found


def add_imported(imports: Imports, line: TherionLine, prefix: str) -> None:
    """Add the stations, legs and cross-sections of the file that an `import` line names.

    A station that several files hold stays where the first one has it, as in Therion.

    Parameters
    ----------
    imports : Imports
    line : TherionLine
    prefix : str
        The open surveys, whose stations the file's are.

    Raises
    ------
    InputError
        If the file is no `.3d`, cannot be read, or an option is not supported.

    References
    ----------
    The Therion Book, "import".
    """
    made, options = imports.made, _options_of(line)
    file = named_file(line, imports.folder)
    if file.suffix.lower() != ".3d":
        raise InputError(f"{line.where}: import {file.name!r}: only .3d files are imported")
    survey = read_3d(file)
    names = _names(survey, options, prefix, imports.surveys)
    made.add(line, "*begin")
    cs = options.cs or survey.crs
    if imports.has_place and cs:
        made.add(line, f"*cs {cs_for_survex(line.where, (cs,)).name}")
    first_at: dict[tuple[float, ...], str] = {}
    for name, at in zip(names, (survey.positions_m + options.moved_m).tolist(), strict=True):
        if name and prefix + name not in imports.fixed:
            imports.fixed.add(prefix + name)
            first = first_at.setdefault(tuple(at), name)
            east, north, up = at
            made.add(
                line, f"*fix {name} {east:.2f} {north:.2f} {up:.2f}" if first == name else f"*equate {first} {name}"
            )
    _add_legs(made, line, survey, names)
    for passage in survey.passages:
        rows = [(line, names[k], lrud) for k, lrud in zip(passage.stations, passage.lrud_m.tolist(), strict=True)]
        if all(name for _, name, _ in rows):
            made.add_passage(rows)
    made.add(line, "*end")


def _options_of(line: TherionLine) -> _Options:
    found = _Options()
    words = list(line.words[2:])
    stated: dict[str, str] = {}
    while words:
        option = words.pop(0)
        if option not in ("-surveys", "-filter", "-calibrate", "-cs", "-fmt", "-format") or not words:
            raise InputError(f"{line.where}: import option {option[:40]!r} is not supported")
        stated[option] = words.pop(0).strip("[]")
    surveys = stated.get("-surveys", found.surveys)
    if surveys not in _SURVEYS:
        raise InputError(f"{line.where}: import -surveys {surveys[:40]!r}: want {', '.join(_SURVEYS)}")
    try:
        numbers = [plain_number(word) for word in stated.get("-calibrate", "0 0 0 0 0 0").split()]
    except ValueError:
        numbers = []
    if len(numbers) != 6 or not np.isfinite(numbers).all():
        raise InputError(f"{line.where}: import -calibrate: want six numbers, x y z in the file and x y z here")
    x, y, z = (numbers[k + 3] - numbers[k] for k in range(3))
    return _Options(surveys, stated.get("-filter", ""), (x, y, z), stated.get("-cs", ""))


def _names(survey: SolvedSurvey, options: _Options, prefix: str, surveys: set[str]) -> list[str]:
    """Return the stations' names as Survex reads them; nothing for stations that are not taken."""
    taken = (name if name.startswith(options.filter) else "" for name in survey.names)
    return [name and _written(name, options, prefix, surveys) for name in taken]


def _written(name: str, options: _Options, prefix: str, known: set[str]) -> str:
    """Return the name of a station.

    Surveys that are not created are part of its own name: with `use` those that the project does not have, with
    `ignore` all.
    """
    *surveys, station = name[len(options.filter) :].lstrip(".").split(".")
    within = list(accumulate((f"{written_survey(part)}." for part in surveys), initial=""))
    if options.surveys == "create":
        known.update(prefix + place for place in within[1:])
    missing = (k for k, place in enumerate(within[1:]) if options.surveys == "ignore" or prefix + place not in known)
    count = next(missing, len(surveys))
    return within[count] + written_name(".".join([*surveys[count:], station]))


def _add_legs(made: SurvexText, line: TherionLine, survey: SolvedSurvey, names: list[str]) -> None:
    made.add(line, "*data cartesian from to easting northing altitude")
    vectors = survey.positions_m[survey.legs[:, 1]] - survey.positions_m[survey.legs[:, 0]]
    before = 0
    for (start, end), flags, (x, y, z) in zip(
        survey.legs.tolist(), survey.leg_flags.tolist(), vectors.tolist(), strict=True
    ):
        if not names[start] or start == end:
            continue
        if flags != before:
            made.add_flags(line, [word for bit, word in _FLAGS.items() if flags & bit])
            before = flags
        names[end] = names[end] or made.unnamed_station()
        made.add(line, f"{names[start]} {names[end]} {x:.2f} {y:.2f} {z:.2f}")
