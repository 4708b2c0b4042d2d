"""Cross-sections of Walls survey files (.srv): distances left, right, up and down, which Survex does not read."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from minesurveys.remarks import warn_user
from minesurveys.solved.model import Passage, SolvedSurvey
from minesurveys.solved.project_files import file_text

_FOOT_M = 0.3048
_SECTION = re.compile(r"\s[<*]([^<>*]*)[>*]")
_NUMBER = r"(\d+\.?\d*|\.\d+)?"
_DISTANCE = re.compile(rf"{_NUMBER}([fmi]?){_NUMBER}", re.IGNORECASE)
_ORDER = re.compile(r"([FT])B?:([LRUD]{4})", re.IGNORECASE)
_DIRECTIVE = re.compile(r"\s*#\s*([A-Za-z]+)([123]?)\b(.*)")
_METRES = {"m": 1.0, "f": _FOOT_M}


@dataclass(frozen=True)
class _Units:
    """Metres of a distance without a unit, the order of the four distances, and whether the second station has them."""

    metres: float = 1.0
    order: str = "LRUD"
    is_at_end: bool = False

    def after(self, words: str) -> _Units:
        """Return the units after the words of `#units`."""
        found = self
        for word in words.lower().split():
            name, _, value = word.partition("=")
            if name in ("m", "meters", "f", "feet", "s") and (value or name)[0] in _METRES:
                found = replace(found, metres=_METRES[(value or name)[0]])
            elif name == "reset":
                found = _Units()
            elif name == "lrud" and (order := _ORDER.fullmatch(value)):
                found = replace(found, order=order[2].upper(), is_at_end=order[1] == "t")
        return found


@dataclass
class _SectionReader:
    """A reading of a file: its units, those that were saved, its prefixes from the first level, and its passages."""

    units: _Units
    saved: list[_Units] = field(default_factory=list)
    prefixes: list[str] = field(default_factory=lambda: [""] * 3)
    passages: list[list[tuple[str, list[float]]]] = field(default_factory=list)

    def read(self, line: str) -> None:
        directive = _DIRECTIVE.match(line)
        if directive is not None:
            self._direct(directive[1].lower(), directive[2], directive[3])
            return
        section = _SECTION.search(line)
        before = (line[: section.start()] if section else line).split()
        if not before or line.lstrip().startswith("#"):
            return
        lrud = [math.nan] * 4 if section is None else self._distances(section[1])
        if len(before) == 1:
            self._alone(self._name(before[0]), lrud)
        elif "-" not in before[:2]:
            self._shot(self._name(before[0]), self._name(before[1]), lrud)

    def _direct(self, name: str, level: str, words: str) -> None:
        if name in ("units", "u"):
            if "save" in words.lower().split():
                self.saved.append(self.units)
            if "restore" in words.lower().split() and self.saved:
                self.units = self.saved.pop()
            self.units = self.units.after(words)
        elif name in ("prefix", "p"):
            first = int(level or "1")
            self.prefixes[first - 1] = words.strip()
            self.prefixes[: first - 1] = [""] * (first - 1)

    def _name(self, text: str) -> str:
        """Return a station's whole name as Survex writes it: without empty prefixes at its beginning."""
        *given, station = text.split(":")
        levels = [*reversed(self.prefixes)]
        levels[len(levels) - len(given) :] = given
        return ":".join([*":".join(levels).lstrip(":").split(":"), station]).lstrip(":")

    def _distances(self, text: str) -> list[float]:
        """Return the distances left, right, up and down, m; nan where none was measured."""
        words = text.replace(",", " ").split()[:4]
        stated = dict(zip(self.units.order, (self._metres(word) for word in words), strict=False))
        return [stated.get(letter, math.nan) for letter in "LRUD"]

    def _metres(self, word: str) -> float:
        found = _DISTANCE.fullmatch(word)
        if found is None or not (found[1] or found[3]):
            return math.nan
        unit, whole, inches = found[2].lower(), float(found[1] or 0), float(found[3] or 0)
        if unit == "i":
            return (whole + inches / 12) * _FOOT_M
        return whole * _METRES.get(unit, self.units.metres)

    def _shot(self, start: str, end: str, lrud: list[float]) -> None:
        unknown = [math.nan] * 4
        if not self.passages or self.passages[-1][-1][0] != start:
            self.passages.append([(start, unknown)])
        if not self.units.is_at_end:
            self._alone(start, lrud)
        self.passages[-1].append((end, lrud if self.units.is_at_end else unknown))

    def _alone(self, station: str, lrud: list[float]) -> None:
        """Read the section of the last station of the passage."""
        if self.passages and self.passages[-1][-1][0] == station and not all(map(math.isnan, lrud)):
            self.passages[-1][-1] = (station, lrud)


def with_sections(survey: SolvedSurvey, files: list[tuple[Path, str]]) -> SolvedSurvey:
    """Return a solved survey with the cross-sections of its files, each with the `.OPTIONS` of its project.

    References
    ----------
    Walls, "Passage dimensions" and "#UNITS": `<left,right,up,down>` or `*...*`, `LRUD=F:LRUD`, `S=FEET`.
    """
    number = {name: k for k, name in enumerate(survey.names)} | {
        name.casefold(): k for k, name in enumerate(survey.names)
    }
    passages, unknown = [], dict[str, None]()
    for path, options in files:
        for rows in _passages(path, options):
            at = [number.get(name, number.get(name.casefold(), -1)) for name, _ in rows]
            unknown |= {name: None for (name, _), k in zip(rows, at, strict=True) if k < 0}
            if min(at) >= 0:
                passages.append(Passage(np.array(at, np.int64), np.array([lrud for _, lrud in rows])))
    if unknown:
        warn_user(
            "cross-sections are of no station that Survex has and are left out: the first is that of "
            f"{next(iter(unknown))[:60]}",
            of=files[0][0].name,
            count=len(unknown),
        )
    return replace(survey, passages=(*survey.passages, *passages))


def _passages(path: Path, options: str) -> list[list[tuple[str, list[float]]]]:
    """Return the passages of a file in which at least one distance was measured."""
    reader, is_comment = _SectionReader(_Units().after(options)), False
    for line in file_text(path).splitlines():
        mark = line.strip()[:2]
        if mark in ("#[", "#]"):
            is_comment = mark == "#["
        elif not is_comment:
            reader.read(line.partition(";")[0])
    return [
        rows
        for rows in reader.passages
        if len(rows) > 1 and not all(math.isnan(wall) for _, lrud in rows for wall in lrud)
    ]
