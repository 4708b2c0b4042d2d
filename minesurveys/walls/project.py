"""Walls projects: the survey files that they name, and a copy of them that names no other file.

Survex follows every path that a project names. It gets copies in a folder of its own instead, in which each name is
that of a copy, so that it opens nothing else.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user
from minesurveys.solved.project_files import inside
from minesurveys.survex.survex_text import Written

_COMMAND = re.compile(rb"\s*\.([A-Za-z0-9]+)[ \t]*(.*?)[ \t\x1a]*", re.DOTALL)
_LINE_END = re.compile(rb"\r\n|\n|\r")
_DETACHED, _OTHER_TYPE = 0x000002, 0x010000  # bits of .STATUS: left out of the book around it; no survey file
_PROJECT, _SURVEY = "made.wpj", ".srv"


@dataclass
class WallsCopy(Written):
    """The content of a project or of one survey file, and the files that it is made of."""

    path: Path
    project: bytes = b""
    surveys: list[Path] = field(default_factory=list)
    options: list[str] = field(default_factory=list)  # of each survey: `.OPTIONS` of its books and its own

    @property
    def files(self) -> list[Path]:  # type: ignore[override]
        """Return the main file, and the surveys that it names."""
        return [self.path, *self.surveys]

    def write(self, folder: Path) -> Path:
        """Write the copy into a folder, and return its main file."""
        for number, survey in enumerate(self.surveys):
            (folder / f"{_copy_name(number)}{_SURVEY}").write_bytes(read_text_bytes(survey))
        if not self.project:
            return folder / f"{_copy_name(0)}{_SURVEY}"
        (folder / _PROJECT).write_bytes(self.project)
        return folder / _PROJECT

    def origin(self, file: Path, number: int) -> tuple[Path, int]:
        """Return the file and line of which a line of a copy is one."""
        names = [_copy_name(k) for k in range(len(self.surveys))]
        return (self.surveys[names.index(file.stem)] if file.stem in names else self.path), number


@dataclass
class _Entry:
    """A book or a survey: its folder, its name and its status, and the lines that state them."""

    folder: Path | None
    is_survey: bool = False
    name: str = ""
    options: str = ""
    status: int = _DETACHED  # Survex leaves out an entry without a status
    name_line: int = -1
    status_line: int = -1


def copy_of(path: Path) -> WallsCopy:
    """Return a copy of a `.srv` file, or of a `.wpj` project with the files that it names.

    Folders and files are found whatever their case, as in Windows. Files in folders that are not there are left out, as
    in Walls, and a warning counts them.

    Raises
    ------
    InputError
        If a named file is missing or outside the project's folder, or the files exceed `survex_files`, `survex_depth`
        or, together, `text_bytes`. The message names the file and the line.

    References
    ----------
    Walls, "Project file". Survex 1.4.22, src/datain.c, says which entries are left out.
    """
    if path.suffix.lower() == _SURVEY:
        return WallsCopy(path, surveys=[path], options=[""])
    copy = WallsCopy(path)
    lines = _LINE_END.split(read_text_bytes(path))
    reader = _Reader(copy, lines)
    reader.read()
    if reader.absent:
        warn_user("survey files lie in folders that are not there; they are left out", of=path, count=reader.absent)
    size = sum(file.stat().st_size for file in copy.surveys)
    if size > reader_limits().text_bytes:
        raise InputError(
            f"{path}: its files have {size} bytes, the limit is {reader_limits().text_bytes} (text_bytes in {FILE})"
        )
    copy.project = b"\n".join(lines)
    return copy


class _Reader:
    """A reading of a project: open books, and the survey whose lines are read."""

    def __init__(self, copy: WallsCopy, lines: list[bytes]) -> None:
        self.copy, self.lines = copy, lines
        self.root = copy.path.parent.resolve()
        self.open = [_Entry(copy.path.parent)]
        self.absent = 0

    def read(self) -> None:
        for number, line in enumerate(self.lines):
            found = _COMMAND.fullmatch(line)
            if found is None:
                continue
            command, text = found[1].upper(), found[2].decode("latin-1")
            if command in (b"BOOK", b"SURVEY", b"ENDBOOK"):
                self._end_survey()
                self._begin(number, command)
            elif command == b"NAME":
                self.open[-1].name, self.open[-1].name_line = text, number
                self.lines[number] = b".NAME none"
            elif command == b"PATH":
                self.open[-1].folder = self._folder(number, self.open[-1].folder, text)
                self.lines[number] = b";"
            elif command == b"OPTIONS":
                self.open[-1].options = text
            elif command == b"STATUS":
                self.open[-1].status = int(text) if re.fullmatch(r"\d{1,9}", text) else _DETACHED
                self.open[-1].status_line = number
        self._end_survey()

    def _begin(self, number: int, command: bytes) -> None:
        if command == b"ENDBOOK":
            if len(self.open) > 1:
                self.open.pop()
            return
        if len(self.open) > reader_limits().survex_depth:
            most = reader_limits().survex_depth
            raise InputError(f"{self._where(number)}: books are nested more than {most} deep (survex_depth in {FILE})")
        self.open.append(_Entry(self.open[-1].folder, command == b"SURVEY"))

    def _end_survey(self) -> None:
        entry = self.open[-1]
        if not entry.is_survey:
            return
        self.open.pop()
        books = [book for book in self.open[2:] if book.status_line >= 0]  # a project's first book is detached always
        if any(one.status & _DETACHED for one in [*books, entry]) or entry.status & _OTHER_TYPE or not entry.name:
            return
        if entry.folder is None:
            self.absent += 1
            self.lines[entry.status_line] = f".STATUS {_DETACHED}".encode()
            return
        if len(self.copy.surveys) + 1 >= reader_limits().survex_files:
            most = reader_limits().survex_files
            raise InputError(f"{self._where(entry.name_line)}: {most} files or more (survex_files in {FILE})")
        self.lines[entry.name_line] = f".NAME {_copy_name(len(self.copy.surveys))}".encode()
        self.copy.surveys.append(self._file(entry))
        self.copy.options.append(" ".join([*(book.options for book in self.open), entry.options]))

    def _file(self, entry: _Entry) -> Path:
        assert entry.folder is not None
        where = self._where(entry.name_line)
        for name in (entry.name, f"{entry.name}{_SURVEY}"):
            wanted = inside(where, name, entry.folder, self.root)
            for option in _alike(wanted):
                file = inside(where, option.name, option.parent, self.root)  # it may be a link
                if file.is_file() and file.suffix.lower() == _SURVEY:
                    return file
        raise InputError(f"{where}: .NAME {entry.name[:80]!r}: no such file")

    def _folder(self, number: int, beside: Path | None, text: str) -> Path | None:
        """Return a folder below another one, or None if it is not there."""
        if beside is None or not text:
            return beside
        for part in text.replace("\\", "/").split("/"):
            if part:
                wanted = inside(self._where(number), part, beside, self.root)
                found = next((option for option in _alike(wanted) if option.is_dir()), None)
                if found is None:
                    return None
                beside = inside(self._where(number), found.name, beside, self.root)
        return beside

    def _where(self, number: int) -> str:
        return f"{self.copy.path}:{number + 1}"


def _alike(wanted: Path) -> list[Path]:
    """Return the file of a name, and those whose names differ in case only."""
    if wanted.exists():
        return [wanted]
    if not wanted.parent.is_dir():
        return []
    return sorted(other for other in wanted.parent.iterdir() if other.name.lower() == wanted.name.lower())


def _copy_name(number: int) -> str:
    return f"file{number}"
