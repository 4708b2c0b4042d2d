"""The files of a Survex project, found before Survex opens any of them.

Survex follows every path that a file names. Only files below the main file's folder may be named, also through links.
The scan is wider than Survex's own reading: it may refuse a harmless line, and finds every path that Survex would open.
So a file may hold no character that Survex reads in another way than the scan, and names only files of its own format:
Survex would read another one by that format's rules.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.limits import FILE, reader_limits

_BLANK = "[ \t,]*"  # Survex reads commas as blanks
COMMAND = re.compile(rf"{_BLANK}\*{_BLANK}([a-z]+)(.*)", re.IGNORECASE | re.DOTALL)
_WORD = re.compile(r'[ \t,]*(?:"([^"]*)"?|([^ \t,]+))')
_LINE_END = r"\r\n|\n\r|\n|\r"
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f]")  # all but tabs and ends of lines; Ctrl-Z ends a line as well
_MARK, _END_OF_TEXT = b"\xef\xbb\xbf", b"\x1a\0 \t\r\n"  # of UTF-8; of DOS
# These change which characters begin a command or a comment, so that lines would mean something else than they show.
_UNSAFE_SETS = {"blank", "comment", "eol", "keyword"}
_SET_ITEMS = {"decimal", "minus", "names", "omit", "plus", "root", "separator"}
# PROJ opens files that such a definition names.
_PROJ_FILES = re.compile(r"[/\\@]|init|grids|pipeline|geoid|file", re.IGNORECASE)
_SURVEX = {".svx", ""}
_NAME_BYTES = 240  # Linux takes 255; a suffix may be added


def project_files(path: Path) -> list[Path]:
    """Return a project's files: the main file, and every file that it includes, in order.

    Parameters
    ----------
    path : Path
        A `.svx` file.

    Raises
    ------
    InputError
        If a named file is missing or outside the main file's folder, a file includes itself, or the project exceeds
        `survex_files` or `survex_depth`. The message names the file and the line.
    """
    files: list[Path] = []
    _scan(path, path.parent.resolve(), files, [])
    return list(dict.fromkeys(files))


def plain_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line numbers and lines as `text_lines`, and refuse control characters but tabs.

    Raises
    ------
    InputError
        Naming the file, the line and the first such character.
    """
    for number, line in text_lines(path):
        found = _CONTROL.search(line)
        if found is not None:
            raise InputError(f"{path}:{number}: a control character, 0x{ord(found[0]):02x}; remove it")
        yield number, line


def text_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line numbers and lines as Survex counts them: they end with a line feed, a return, or both.

    Raises
    ------
    InputError
        If the file or a line exceeds its limit.
    """
    most = reader_limits().survex_line_bytes
    for number, line in enumerate(re.split(_LINE_END, file_text(path)), start=1):
        if len(line) > most:
            raise InputError(
                f"{path}:{number}: a line of {len(line)} bytes, at most {most} (survex_line_bytes in {FILE})"
            )
        yield number, line


def file_text(path: Path) -> str:
    """Return a file's text without a mark of UTF-8 at its beginning and a mark of DOS at its end."""
    return read_text_bytes(path).removeprefix(_MARK).rstrip(_END_OF_TEXT).decode("latin-1")


def inside(where: str, name: str, beside: Path, folder: Path) -> Path:
    """Return the path of a named file beside another file, and refuse one outside the folder.

    Raises
    ------
    InputError
        The message begins with `where`.
    """
    clean = name.replace("\\", "/")
    too_long = len(clean) > 1000 or any(len(part.encode()) > _NAME_BYTES for part in clean.split("/"))
    if not clean or not clean.isprintable() or too_long:
        raise InputError(f"{where}: {name[:80]!r} is no file name")
    candidate = beside / clean
    drive = len(clean) > 1 and clean[1] == ":"
    try:
        outside = clean.startswith(("/", "~")) or drive or not candidate.resolve().is_relative_to(folder)
    except (OSError, RuntimeError) as error:  # a link that leads to itself, or a name that is too long
        raise InputError(f"{where}: {name[:80]!r} cannot be opened") from error
    if outside:
        raise InputError(
            f"{where}: {name[:80]!r} is outside the survey's folder, that of the main file; put the main file into a "
            "folder that holds all files, and name them from there"
        )
    return candidate


def _scan(path: Path, folder: Path, files: list[Path], above: list[Path]) -> None:
    limits = reader_limits()
    files.append(path)
    if len(files) > limits.survex_files:
        raise InputError(f"{path}: more than {limits.survex_files} files (survex_files in {FILE})")
    depth = 0
    for number, line in plain_lines(path):
        found = COMMAND.match(line)
        if found is None:
            continue
        where, command, rest = f"{path}:{number}", found[1].lower(), found[2]
        if command == "begin":
            depth += 1
            if depth > limits.survex_depth:
                raise InputError(
                    f"{where}: *begin is nested more than {limits.survex_depth} deep (survex_depth in {FILE})"
                )
        elif command == "end":
            depth -= 1
        elif command == "set":
            _require_plain_set(where, rest)
        elif command == "cs" and not rest.partition(";")[0].strip(" \t,"):
            raise InputError(f"{where}: *cs names no coordinate system")
        elif command == "cs" and _PROJ_FILES.search(rest.partition(";")[0]):
            raise InputError(f"{where}: *cs {rest.strip()[:60]!r}: a definition that can name files is not read")
        elif command == "include":
            file = included_file(where, rest, path, folder)
            if file.resolve() in [one.resolve() for one in (*above, path)]:
                raise InputError(f"{where}: *include {file.name!r}: the file includes itself")
            if len(above) >= limits.survex_depth:
                raise InputError(
                    f"{where}: files include files more than {limits.survex_depth} deep (survex_depth in {FILE})"
                )
            _scan(file, folder, files, [*above, path])


def named_or_lower_case(where: str, what: str, name: str, beside: Path, folder: Path, suffix: str) -> Path:
    """Return the file of a name, with or without the suffix, or that of the name in lower case.

    Raises
    ------
    InputError
        If there is none. The message begins with `where` and `what`.
    """
    for text in (name, f"{name}{suffix}"):
        option = inside(where, text, beside, folder)
        if option.is_file():
            return option
    found = _lower_case(where, name, beside, folder, suffix)
    if not found:
        raise InputError(f"{where}: {what}: no such file")
    return found[0]


def _lower_case(where: str, name: str, beside: Path, folder: Path, suffix: str) -> list[Path]:
    """Return what Survex opens if there is no file of a name: that of the name in lower case.

    Files come from systems that do not distinguish cases. A name that could be another file too, which Survex might
    open instead, is not taken.
    """
    options = [inside(where, f"{name.lower()}{end}", beside, folder) for end in ("", suffix)]
    found = [option for option in options if option.is_file()]
    alike = (
        []
        if not found
        else [
            other
            for other in found[0].parent.iterdir()
            if other.name.lower() in {option.name.lower() for option in options}
        ]
    )
    return found if len(alike) == 1 else []


def _require_plain_set(where: str, rest: str) -> None:
    word = _WORD.match(rest)
    item = (word[1] or word[2] or "").lower() if word else ""
    if item not in _SET_ITEMS:
        reason = "it changes how lines are read" if item in _UNSAFE_SETS else "it is unknown"
        raise InputError(f"{where}: *set {item[:30]} is not supported: {reason}")


def included_file(where: str, rest: str, path: Path, folder: Path) -> Path:
    """Return the file that `*include` names in a file; `rest` is what follows the command.

    Raises
    ------
    InputError
        If there is none below the folder. The message begins with `where`.
    """
    word = _WORD.match(rest)
    name = (word[1] if word[1] is not None else word[2]) if word else ""
    if ";" in name:
        raise InputError(f"{where}: *include {name[:80]!r}: a file name with ; is not read")
    file = named_or_lower_case(where, f"*include {name[:80]!r}", name, path.parent, folder, ".svx")
    if "\\" in name and any((path.parent / text).exists() for text in (name, f"{name}.svx")):
        raise InputError(f"{where}: *include {name[:80]!r}: a file whose name holds a backslash; rename it")
    if file.suffix.lower() not in _SURVEX:
        raise InputError(f"{where}: *include {name[:80]!r}: only .svx files are included")
    return file
