"""Survex data that we write from other formats, and names that Survex reads whatever their characters."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

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
        """Return the name of a new station whose name `read_names` leaves out."""
        self.unnamed += 1
        return f"{_UNNAMED}{self.unnamed}"

    def origin(self, number: int) -> tuple[Path, int]:
        """Return the file and line from which a line, counted from 1, was made."""
        line = self.origins[min(max(number, 1), len(self.origins)) - 1]
        return line.path, line.number


def written_name(name: str) -> str:
    """Return a name of any characters as one that Survex reads; `read_name` returns it again."""
    if _PLAIN.fullmatch(name):
        return name
    return "".join(c if _PLAIN.fullmatch(c) else f"+{ord(c):x}+" for c in name)


def written_survey(name: str) -> str:
    """Return a survey's name as `written_name`, with a mark: a station of its name may lie beside the survey."""
    return f"{written_name(name)}+"


def read_names(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names that were written, empty for stations without one.

    Two names that would become one stay as Survex has them.
    """
    written = list(names)
    read = [read_name(name) for name in written]
    counts: dict[str, int] = {}
    for name in read:
        counts[name] = counts.get(name, 0) + 1
    return tuple(new if counts[new] == 1 or not new else old for old, new in zip(written, read, strict=True))


def read_name(name: str) -> str:
    """Return the name of a station, with its surveys, that was written."""
    *surveys, station = name.split(".")
    if station.startswith(_UNNAMED):
        return ""
    return ".".join(read_text(part) for part in [*(survey.removesuffix("+") for survey in surveys), station])


def read_text(text: str) -> str:
    """Return a text of Survex with the characters that names in it stand for."""
    return _WRITTEN.sub(lambda found: chr(min(int(found[1], 16), 0x10FFFF)), text)
