"""Cross-sections of Compass survey data (.dat), which Survex solves without them."""

from __future__ import annotations

import functools
import math
import operator
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.guard.plain_number import plain_number
from pipeline.survey.solved.model import LegFlag, Passage, SolvedSurvey
from pipeline.survey.solved.project_files import text_lines

_FOOT_M = 0.3048
_UNKNOWN_FT = 900.0  # Compass writes 999.9 or a negative number for a distance that was not measured
_FORMAT = re.compile(r"FORMAT:\s*([A-Z]{11,15})")
_FLAGS = re.compile(r"#\|([A-Za-z]*)#")
# Survex 1.4.4 reads S (splay) and P (not plotted) as legs like all others. A shot with X it leaves out itself.
_BESIDE = LegFlag.SPLAY | LegFlag.SURFACE
_NO_PASSAGE = {"S": LegFlag.SPLAY, "P": LegFlag.SURFACE}
_Row = tuple[str, str, list[float], bool, str]  # from, to, left right up down m, whether at `to`, flags
_Ends = frozenset[tuple[float, ...]]  # the places of a leg's stations


def with_sections(survey: SolvedSurvey, files: list[Path]) -> SolvedSurvey:
    """Return a survey with the cross-sections of its Compass files.

    Shots in a row, each from the station where the one before it ends, make a passage. A distance is at the shot's
    first station, or at its second if the survey's format says so. Shots that Survex leaves out, or takes for splays or
    for legs on the surface, have no passage (flags X, S and P).

    Raises
    ------
    InputError
        If a distance is not a number. The message names the file and the line.

    References
    ----------
    Compass, "Survey data file format": FROM TO LENGTH BEARING INC LEFT UP DOWN RIGHT, in feet; the last letter of
    FORMAT is T if passages are measured at the TO station.
    """
    number = {name: i for i, name in enumerate(survey.names) if name}
    rows = [[row for row in _rows(path) if row[0] in number and row[1] in number] for path in files]
    survey = _with_flags(survey, number, rows)
    driven = {ends for ends, flag in zip(_ends(survey), survey.leg_flags, strict=True) if not flag & _BESIDE}
    passages: list[Passage] = []
    for shots in rows:
        chain: list[tuple[str, list[float]]] = []
        for start, end, lrud, at_end, _ in shots:
            if _places(survey, number[start], number[end]) not in driven:
                continue
            unknown = [math.nan] * 4
            if not chain or chain[-1][0] != start:
                passages += _passage(chain, number)
                chain = [(start, unknown)]
            if not at_end:
                chain[-1] = (start, lrud)
            chain.append((end, lrud if at_end else unknown))
        passages += _passage(chain, number)
    return replace(survey, passages=survey.passages + tuple(passages))


def _with_flags(survey: SolvedSurvey, number: dict[str, int], rows: list[list[_Row]]) -> SolvedSurvey:
    """Return a survey whose legs have the flags of their shots that Survex does not read."""
    found: dict[_Ends, int] = {}
    for start, end, _, _, letters in (row for shots in rows for row in shots):
        flag = functools.reduce(operator.or_, (_NO_PASSAGE.get(letter, 0) for letter in letters), 0)
        ends = _places(survey, number[start], number[end])
        found[ends] = found.get(ends, flag) & flag  # a leg that one shot shows to be a passage is one
    flags = [flag | found.get(ends, 0) for ends, flag in zip(_ends(survey), survey.leg_flags.tolist(), strict=True)]
    return replace(survey, leg_flags=np.array(flags, np.uint8))


def _ends(survey: SolvedSurvey) -> list[_Ends]:
    return [_places(survey, start, end) for start, end in survey.legs.tolist()]


def _places(survey: SolvedSurvey, start: int, end: int) -> _Ends:
    """Return where a leg's stations lie: a station may have several names."""
    return frozenset(tuple(survey.positions_m[station].tolist()) for station in (start, end))


def _passage(chain: list[tuple[str, list[float]]], number: dict[str, int]) -> list[Passage]:
    if not any(np.isfinite(lrud).any() for _, lrud in chain):
        return []
    return [Passage(np.array([number[name] for name, _ in chain]), np.array([lrud for _, lrud in chain]))]


def _rows(path: Path) -> Iterator[_Row]:
    """Yield the shots of all surveys of a file. A survey's shots follow the line that begins with FROM."""
    in_shots, at_end = False, False
    for line_number, line in text_lines(path):
        if "\f" in line:
            in_shots, at_end = False, False
            continue
        found = _FORMAT.search(line) if not in_shots else None
        if found is not None:
            at_end = len(found[1]) in (13, 15) and found[1].endswith("T")
        words = line.split()
        if words[:2] == ["FROM", "TO"]:
            in_shots = True
        elif in_shots and len(words) >= 9:
            left, up, down, right = (_wall_m(path, line_number, text) for text in words[5:9])
            flags = _FLAGS.search(line)
            yield words[0], words[1], [left, right, up, down], at_end, flags[1].upper() if flags else ""


def _wall_m(path: Path, line_number: int, text: str) -> float:
    try:
        value = plain_number(text)
    except ValueError:
        raise InputError(f"{path}:{line_number}: {text[:40]!r} is not a distance in feet") from None
    return value * _FOOT_M if 0 <= value < _UNKNOWN_FT else math.nan
