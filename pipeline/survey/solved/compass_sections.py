"""Cross-sections of Compass survey data (.dat), which Survex solves without them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.survey.solved.model import Passage, SolvedSurvey
from pipeline.survey.solved.project_files import text_lines

_FOOT_M = 0.3048
_UNKNOWN_FT = 900.0  # Compass writes 999.9 or a negative number for a distance that was not measured
_FORMAT = re.compile(r"FORMAT:\s*([A-Z]{11,15})")
_Row = tuple[str, str, list[float], bool]  # from, to, left right up down m, whether at `to`


def with_sections(survey: SolvedSurvey, files: list[Path]) -> SolvedSurvey:
    """Return a survey with the cross-sections of its Compass files.

    Shots in a row, each from the station where the one before it ends, make a passage. A distance is at the shot's
    first station, or at its second if the survey's format says so. Stations that Survex does not name are left out.

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
    passages: list[Passage] = []
    for path in files:
        chain: list[tuple[str, list[float]]] = []
        for start, end, lrud, at_end in _rows(path):
            if start not in number or end not in number:
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
            yield words[0], words[1], [left, right, up, down], at_end


def _wall_m(path: Path, line_number: int, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{path}:{line_number}: {text[:40]!r} is not a distance in feet") from None
    return value * _FOOT_M if 0 <= value < _UNKNOWN_FT else math.nan
