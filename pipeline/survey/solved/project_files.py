"""The files of a Survex or Compass project, found before Survex opens any of them.

Survex follows every path that a file names. Only files below the main file's folder may be named, also through links.
The scan is wider than Survex's own reading: it may refuse a harmless line, and finds every path that Survex would open.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from pipeline.errors import InputError
from pipeline.params.reader_limits import FILE, reader_limits
from pipeline.survey.plain_file import read_text_bytes

_BLANK = r"[\s,\0]*"  # Survex reads commas as blanks
_COMMAND = re.compile(rf"{_BLANK}\*{_BLANK}([a-z]+)(.*)", re.IGNORECASE | re.DOTALL)
_WORD = re.compile(r'[\s,\0]*(?:"([^"]*)"?|([^\s,]+))')
_MADE_OF = re.compile(r"#([^,;\r\n]*)")
# These change which characters begin a command or a comment, so that lines would mean something else than they show.
_UNSAFE_SETS = {"blank", "comment", "eol", "keyword"}
_SET_ITEMS = {"decimal", "minus", "names", "omit", "plus", "root", "separator"}
# PROJ opens files that such a definition names.
_PROJ_FILES = re.compile(r"[/\\@]|init|grids|pipeline|geoid|file", re.IGNORECASE)
_COMPASS = {".mak", ".clp"}
_NAME_BYTES = 240  # Linux takes 255; a suffix may be added


def project_files(path: Path) -> list[Path]:
    """Return a project's files: the main file, and every file that it includes, in order.

    Parameters
    ----------
    path : Path
        A `.svx`, `.dat` or `.mak` file.

    Raises
    ------
    InputError
        If a named file is missing or outside the main file's folder, a file includes itself, or the project exceeds
        `survex_files` or `survex_depth`. The message names the file and the line.
    """
    files: list[Path] = []
    suffix = path.suffix.lower()
    if suffix in _COMPASS:
        return [path, *_compass_files(path)]
    if suffix == ".dat":
        return [path]
    _scan(path, path.parent.resolve(), files, [])
    return list(dict.fromkeys(files))


def text_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line numbers and lines as Survex counts them: they end with a line feed, a return, or both.

    Raises
    ------
    InputError
        If the file or a line exceeds its limit.
    """
    text = read_text_bytes(path).decode("latin-1")
    most = reader_limits().survex_line_bytes
    for number, line in enumerate(re.split(r"\r\n|\n\r|\n|\r", text), start=1):
        if len(line) > most:
            raise InputError(
                f"{path}:{number}: a line of {len(line)} bytes, at most {most} (survex_line_bytes in {FILE})"
            )
        yield number, line


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
        raise InputError(f"{where}: {name[:80]!r} is outside the survey's folder")
    return candidate


def _scan(path: Path, folder: Path, files: list[Path], above: list[Path]) -> None:
    limits = reader_limits()
    files.append(path)
    if len(files) > limits.survex_files:
        raise InputError(f"{path}: more than {limits.survex_files} files (survex_files in {FILE})")
    depth = 0
    for number, line in text_lines(path):
        found = _COMMAND.match(line)
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
        elif command == "cs" and _PROJ_FILES.search(rest.partition(";")[0]):
            raise InputError(f"{where}: *cs {rest.strip()[:60]!r}: a definition that can name files is not read")
        elif command == "include":
            file = _included(where, rest, path, folder)
            if file.resolve() in [one.resolve() for one in (*above, path)]:
                raise InputError(f"{where}: *include {file.name!r}: the file includes itself")
            if len(above) >= limits.survex_depth:
                raise InputError(
                    f"{where}: files include files more than {limits.survex_depth} deep (survex_depth in {FILE})"
                )
            _scan(file, folder, files, [*above, path])


def _require_plain_set(where: str, rest: str) -> None:
    word = _WORD.match(rest)
    item = (word[1] or word[2] or "").lower() if word else ""
    if item not in _SET_ITEMS:
        reason = "it changes how lines are read" if item in _UNSAFE_SETS else "it is unknown"
        raise InputError(f"{where}: *set {item[:30]} is not supported: {reason}")


def _included(where: str, rest: str, path: Path, folder: Path) -> Path:
    word = _WORD.match(rest)
    name = (word[1] if word[1] is not None else word[2]) if word else ""
    if ";" in name:
        raise InputError(f"{where}: *include {name[:80]!r}: a file name with ; is not read")
    plain = inside(where, name, path.parent, folder)
    with_suffix = inside(where, f"{name}.svx", path.parent, folder)
    for option in (plain, with_suffix):
        if option.is_file():
            return option
    raise InputError(f"{where}: *include {name[:80]!r}: no such file")


def _compass_files(path: Path) -> list[Path]:
    folder, files, count, most = path.parent.resolve(), [], 0, reader_limits().survex_files
    for number, line in text_lines(path):
        comment = line.lstrip().startswith("/")
        for name in _MADE_OF.findall(line):
            where = f"{path}:{number}"
            if not name.strip():
                continue
            count += 1
            if count >= most:
                raise InputError(f"{where}: {most} files or more (survex_files in {FILE})")
            options = [inside(where, text, path.parent, folder) for text in (name.strip(), f"{name.strip()}.dat")]
            file = next((option for option in options if option.is_file()), None)
            if file is None and not comment:
                raise InputError(f"{where}: #{name.strip()[:80]}: no such file")
            if file is not None and file not in files:
                files.append(file)
    return files
