"""Lines of Therion files: comments, continued lines, quoted words, and the files that they name."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.limits import FILE, reader_limits
from minesurveys.solved.project_files import inside

_WORD = re.compile(r'"((?:[^"]|"")*)"|\[([^\]]*)\]|(\S+)')
_DRAWINGS = (".th2", ".xvi")
_INPUTS = ("input", "source", "load")


@dataclass(frozen=True)
class TherionLine:
    """The words of a line, and where it stands."""

    path: Path
    number: int
    words: tuple[str, ...]

    @property
    def where(self) -> str:
        """Return file and line, as errors state it."""
        return f"{self.path}:{self.number}"


def therion_lines(path: Path, files: list[Path]) -> Iterator[TherionLine]:
    """Yield the lines of a file and of the files that it inputs, in order; drawings (`.th2`) are left out.

    `files` receives every file that was read, and those that `import` names.

    Raises
    ------
    InputError
        If an input is missing, outside the main file's folder, or inputs itself, or if there are too many.
    """
    yield from _lines(path, path.parent.resolve(), files, [])


def _lines(path: Path, folder: Path, files: list[Path], above: list[Path]) -> Iterator[TherionLine]:
    limits = reader_limits()
    files.append(path)
    if len(files) > limits.survex_files:
        raise InputError(f"{path}: more than {limits.survex_files} files (survex_files in {FILE})")
    for line in _plain_lines(path):
        word = line.words[0]
        if word == "import":
            files.append(named_file(line, folder))
        if word not in _INPUTS or line.words == ("source",):  # alone, it begins lines of a survey up to endsource
            yield line
            continue
        if len(line.words) > 1 and line.words[1].lower().endswith(_DRAWINGS):  # never opened: it may lie anywhere
            continue
        file = named_file(line, folder)
        if file.resolve() in [one.resolve() for one in (*above, path)]:
            raise InputError(f"{line.where}: {file.name} inputs itself")
        if len(above) >= limits.survex_depth:
            raise InputError(
                f"{line.where}: inputs are nested more than {limits.survex_depth} deep (survex_depth in {FILE})"
            )
        yield from _lines(file, folder, files, [*above, path])


def named_file(line: TherionLine, folder: Path) -> Path:
    """Return the file that a line names; `.th` may be left out.

    Raises
    ------
    InputError
        If it is missing or outside the folder.
    """
    if len(line.words) < 2:
        raise InputError(f"{line.where}: {line.words[0]} names no file")
    file = inside(line.where, line.words[1], line.path.parent, folder)
    for option in (file, file.with_name(file.name + ".th")):
        if option.is_file():
            return option
    raise InputError(f"{line.where}: {line.words[0]} {line.words[1][:80]!r}: no such file")


def _plain_lines(path: Path) -> Iterator[TherionLine]:
    pending, start, comment = "", 0, False
    text = read_text_bytes(path).decode("utf-8", "replace").lstrip("\ufeff")
    for number, raw in enumerate(re.split(r"\r\n|\n|\r", text), start=1):
        content = _without_comment(raw).rstrip()
        if content.endswith("\\"):
            start = start or number
            pending += content[:-1] + " "
            continue
        words = tuple(_words(pending + content))
        first, pending, start = start or number, "", 0
        if words and words[0] in ("comment", "endcomment"):
            comment = words[0] == "comment"
        elif words and not comment:
            yield TherionLine(path, first, words)
    if comment or pending:
        raise InputError(f"{path}: ends within {'a comment without endcomment' if comment else 'a continued line'}")


def _without_comment(text: str) -> str:
    """Return a line up to its comment; a # between quotes begins none."""
    if '"' not in text:
        return text.partition("#")[0]
    quoted = False
    for at, character in enumerate(text):
        if character == '"':
            quoted = not quoted
        elif character == "#" and not quoted:
            return text[:at]
    return text


def _words(text: str) -> Iterator[str]:
    for found in _WORD.finditer(text):
        quoted, bracket, plain = found.groups()
        yield quoted.replace('""', '"') if quoted is not None else f"[{bracket}]" if bracket is not None else plain
