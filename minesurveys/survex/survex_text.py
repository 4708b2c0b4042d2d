"""What we write for Survex to solve, and names that Survex reads whatever their characters."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.solved.project_files import project_files

FLAGS = ("surface", "duplicate", "splay")  # of shots, as Survex and Therion call them
PASSAGE = "*data passage station left right up down"
POINT = "~"  # stands for the point of a station's name, which parts surveys in Survex
NAME_CHARACTERS = f"_-+{POINT}"  # beside letters and digits: `*set names` takes them
_PLAIN = re.compile(r"[A-Za-z0-9_-]*")
# Survex 1.4 knows anonymous stations in the style `normal` only. `written_name` writes ~ otherwise.
_UNNAMED = "~~"
_WRITTEN = re.compile(r"\+([0-9a-f]{1,6})\+")
_FLAGS = re.compile(r"[ \t,]*\*[ \t,]*flags\b(.*)", re.IGNORECASE)
_NOT_DUPLICATE = re.compile(r"\bnot\s+duplicate\b", re.IGNORECASE)
_OTHER = re.compile(r"[ \t,]*\*")
_FOLDER = "project"
_LINE_END = re.compile(r"(\r\n|\n\r|\n|\r)")


class Located(Protocol):
    """A line of a file."""

    @property
    def path(self) -> Path:
        """Return the file."""

    @property
    def number(self) -> int:
        """Return the line, from 1."""


class Written(ABC):
    """What we write for Survex of a survey's `files`, and what its answer is about."""

    files: list[Path]

    @abstractmethod
    def write(self, folder: Path) -> Path:
        """Write it into a folder, and return the main file."""

    @abstractmethod
    def origin(self, file: Path, number: int) -> tuple[Path, int]:
        """Return the user's file and line from which a line, counted from 1, of a written file was made."""

    def message(self, text: str) -> str:
        """Return a message of Survex with the user's names."""
        return text

    def names(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Return the user's names of stations, for those of the solved survey."""
        return names


@dataclass
class SurvexText(Written):
    """Survex data made from another format's, and where each of its lines comes from."""

    files: list[Path] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    origins: list[Located] = field(default_factory=list)
    unnamed: int = 0

    def add(self, line: Located, text: str) -> None:
        """Add one line."""
        self.lines.append(text)
        self.origins.append(line)

    def add_flags(self, line: Located, flags: Collection[str]) -> None:
        """State the flags of the shots that follow, of all three."""
        self.add(line, f"*flags {' '.join(flag if flag in flags else f'not {flag}' for flag in FLAGS)}")

    def add_passage(self, rows: Sequence[tuple[Located, str, Iterable[float]]]) -> None:
        """Add cross-sections in a row: where each is stated, its station's written name, left, right, up and down m."""
        for line, _, _ in rows[:1]:
            self.add(line, PASSAGE)
        for line, name, walls in rows:
            self.add(line, " ".join([name, *("-" if math.isnan(wall) else f"{wall:.4f}" for wall in walls)]))

    def unnamed_station(self) -> str:
        """Return the name of a new station whose name `names` leaves out."""
        self.unnamed += 1
        return f"{_UNNAMED}{self.unnamed}"

    def write(self, folder: Path) -> Path:
        """Write the text into a folder, and return its file."""
        source = folder / "made.svx"
        source.write_text("\n".join(flagged_together(self.lines)) + "\n", encoding="ascii")
        return source

    def origin(self, file: Path, number: int) -> tuple[Path, int]:
        """Return the file and line from which a line, counted from 1, was made."""
        line = self.origins[min(max(number, 1), len(self.origins)) - 1]
        return line.path, line.number

    def message(self, text: str) -> str:
        """Return a message of Survex with names as the user wrote them."""
        return _read_text(text.replace("+.", "."))  # without the marks of surveys

    def names(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Return the names of stations as the user wrote them, empty for stations without one.

        Of stations whose names would become one, all but the first have a number after it, as in a `.3d` file.
        """
        counts: Counter[str] = Counter()
        read = []
        for name in map(_read_name, names):
            counts[name] += 1
            read.append(f"{name} ({counts[name]})" if name and counts[name] > 1 else name)
        return tuple(read)


def written_name(name: str) -> str:
    """Return a name of any characters as one that Survex reads; `SurvexText.names` returns it again."""
    if _PLAIN.fullmatch(name):
        return name
    return "".join(c if _PLAIN.fullmatch(c) else f"+{ord(c):x}+" for c in name)


def written_survey(name: str) -> str:
    """Return a survey's name as `written_name`, with a mark: a station of its name may lie beside the survey."""
    return f"{written_name(name)}+"


def _read_name(name: str) -> str:
    """Return the name of a station, with its surveys, that was written."""
    *surveys, station = name.split(".")
    if station.startswith(_UNNAMED):
        return ""
    return ".".join(_read_text(part) for part in [*(survey.removesuffix("+") for survey in surveys), station])


def _read_text(text: str) -> str:
    """Return a text of Survex with the characters that names in it stand for."""
    return _WRITTEN.sub(lambda found: chr(min(int(found[1], 16), 0x10FFFF)), text.replace(POINT, "."))


def flagged_together(lines: list[str]) -> list[str]:
    """Return the lines of a Survex file with such a first reading after the line that takes its flag back.

    Survex joins readings of a leg in a row, with the first's flags: findings/survex-repeated-leg-takes-first-flags.sh.
    """
    found = list(lines)
    first: tuple[int, list[str]] | None = None  # the last reading: its line, and its stations
    ends_at = -1  # the line that took the flag back since then
    for number, line in enumerate(lines):
        words = line.partition(";")[0].replace(",", " ").split()
        flags = _FLAGS.match(line)
        if flags is not None and _NOT_DUPLICATE.search(flags[1].partition(";")[0]) and ends_at < 0:
            ends_at = number
        elif _OTHER.match(line):
            first, ends_at = None, -1
        elif words:
            stations = words[:2]  # readings from the other end are a leg of their own
            if first is not None and ends_at >= 0 and first[1] == stations and len(stations) == 2:
                found[first[0]], found[ends_at] = found[ends_at], found[first[0]]
            first, ends_at = (number, stations), -1
    return found


@dataclass
class ProjectCopy(Written):
    """The files of a project, all below the main file's folder."""

    path: Path
    files: list[Path]

    def write(self, folder: Path) -> Path:
        """Copy the files into a folder, and return the main one."""
        root = self.path.parent
        for file in self.files:
            copy = folder / _FOLDER / file.relative_to(root)
            copy.parent.mkdir(parents=True, exist_ok=True)
            parts = _LINE_END.split(read_text_bytes(file).decode("latin-1"))  # lines, and what ends each
            parts[::2] = flagged_together(parts[::2])
            copy.write_bytes("".join(parts).encode("latin-1"))
        return folder / _FOLDER / self.path.name

    def origin(self, file: Path, number: int) -> tuple[Path, int]:
        """Return the user's file and line of a line of a copy."""
        return self.path.parent / file.name, number


def project_copy(path: Path) -> ProjectCopy:
    """Return a copy of a `.svx` file and of all files that it includes; `InputError` as `project_files`."""
    return ProjectCopy(path, project_files(path))
