"""What we write for Survex to solve, and names that Survex reads whatever their characters."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from pipeline.survey.survex.repeated import flagged_together

NAME_CHARACTERS = "_-+~"  # beside letters and digits: `*set names` takes them
_PLAIN = re.compile(r"[A-Za-z0-9_-]*")
# Survex 1.4 knows anonymous stations in the style `normal` only. `written_name` writes ~ otherwise.
_UNNAMED = "~~"
_WRITTEN = re.compile(r"\+([0-9a-f]{1,6})\+")


class Located(Protocol):
    """A line of a file."""

    @property
    def path(self) -> Path:
        """Return the file."""

    @property
    def number(self) -> int:
        """Return the line, from 1."""


class Written(Protocol):
    """Files that we write for Survex, and what its answer is about."""

    def write(self, folder: Path) -> Path:
        """Write the files into a folder, and return the main one."""

    def origin(self, file: Path, number: int) -> tuple[Path, int]:
        """Return the user's file and line from which a line, counted from 1, of a written file was made."""

    def message(self, text: str) -> str:
        """Return a message of Survex with the user's names."""

    def names(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Return the user's names of stations, for those of the solved survey."""


@dataclass
class SurvexText:
    """Survex data made from another format's, and where each of its lines comes from."""

    lines: list[str] = field(default_factory=list)
    origins: list[Located] = field(default_factory=list)
    unnamed: int = 0

    def add(self, line: Located, text: str) -> None:
        """Add one line."""
        self.lines.append(text)
        self.origins.append(line)

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
    return _WRITTEN.sub(lambda found: chr(min(int(found[1], 16), 0x10FFFF)), text)
