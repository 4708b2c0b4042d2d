"""Compass project files (.mak): the data files with their stations, in their coordinate systems."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from minesurveys.errors import InputError
from minesurveys.guard.plain_number import plain_number
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user
from minesurveys.solved.project_files import file_text, inside, named_or_lower_case, plain_lines

_COMMENT = re.compile(r"/[^/\r\n]*/?")
_STATION = re.compile(r"\s*([^\s\[,;]+)\s*(?:\[([^\]]*)\])?[^,]*")
_NUMBER = re.compile(r"[-+.\d][-+.\deE]*")
_FOOT_M = 0.3048
_FARTHEST_M = 1e8
_SUFFIXES = (".dat", ".clp")
# Datum as Compass writes it -> the first and last zone, south negative, and the code of zone 0.
_ZONES: dict[str, tuple[tuple[int, int, int], ...]] = {
    "ADINDAN": ((35, 38, 20100),),
    "ARC 1950": ((-36, -34, 20900),),
    "ARC 1960": ((-37, -35, 21000),),
    "CAPE": ((-36, -34, 22200),),
    "EUROPEAN 1950": ((28, 38, 23000),),
    "GEODETIC 1949": ((58, 60, 27200),),
    "HU TZU SHAN": ((51, 51, 3778),),
    "INDIAN": ((48, 49, 3100),),
    "NORTH AMERICAN 1927": ((1, 23, 26700), (59, 60, 3311)),
    "NORTH AMERICAN 1983": ((1, 23, 26900), (24, 24, 9688), (59, 60, 3313)),
    "TOKYO": ((51, 55, 3041),),
    "WGS 1972": ((1, 60, 32200), (-60, -1, 32300)),
    "WGS 1984": ((1, 60, 32600), (-60, -1, 32700)),
}


@dataclass(frozen=True)
class ProjectLine:
    """Where a command of a project stands."""

    path: Path
    number: int

    @property
    def where(self) -> str:
        """Return file and line, as errors state it."""
        return f"{self.path}:{self.number}"


@dataclass(frozen=True)
class Fixed:
    """A station and its place, m east, north and up in the coordinate system of its file."""

    name: str
    place_m: tuple[float, float, float]


@dataclass(frozen=True)
class ProjectFile:
    """A data file of a project.

    `system` is the coordinate system by its EPSG code, empty for a local grid; `base_m` is where the project computes
    magnetic declinations, in `base_system`. `links` are the stations that are joined to those of the files before.
    """

    line: ProjectLine
    path: Path
    fixed: tuple[Fixed, ...] = ()
    links: tuple[str, ...] = ()
    system: str = ""
    base_system: str = ""
    base_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class _Command:
    line: ProjectLine
    sign: str
    text: str


def read_project(path: Path) -> list[ProjectFile]:
    """Read a project file.

    Raises
    ------
    InputError
        If a data file is missing, lies outside the project's folder or is none, a station's place is not stated in
        feet or metres, or there are more than `survex_files`. The message names the file and the line.

    References
    ----------
    Compass, "Project file format": `#file,station[unit,east,north,up],...;`, `[folder;` and `];`, `$zone;`, `&datum;`,
    `@east,north,up,zone,convergence;`, and comments from one / to the next or the end of the line. Convergences (% and
    *) are computed.
    """
    files: list[ProjectFile] = []
    folder, folders = path.parent.resolve(), [path.parent]
    datum, zone, base = "", 0, ""
    base_m = (0.0, 0.0, 0.0)
    unknown: dict[str, None] = {}
    for command in _commands(path):
        where = command.line.where
        if command.sign == "[":
            folders.append(inside(where, command.text, folders[-1], folder))
        elif command.sign == "]" and len(folders) > 1:
            folders.pop()
        elif command.sign == "&":
            datum = command.text
        elif command.sign == "$":
            zone = _zone(where, command.text)
        elif command.sign == "@":
            base, base_m = _base(where, command.text)
        elif command.sign == "#" and command.text:
            if len(files) + 1 >= reader_limits().survex_files:
                raise InputError(f"{where}: {reader_limits().survex_files} files or more (survex_files in {FILE})")
            base_system = utm_system(datum, _zone(where, base)) if base else ""
            system = utm_system(datum, zone) or base_system
            if zone and datum and not system:
                unknown[f"{datum[:40]}, zone {zone}"] = None
            files.append(_file(command, folders[-1], folder, system, base_system, base_m))
    for name in unknown:
        warn_user(
            f"{name}: no EPSG code; coordinates are of a local grid, and declinations those of the surveys", of=path
        )
    return files


def _commands(path: Path) -> Iterator[_Command]:
    """Yield the commands. Each has a sign and ends with a semicolon; folders and datums also end with their line."""
    for _ in plain_lines(path):  # their lengths and characters
        pass
    text = re.sub(r"\r\n|\n\r|\r", "\n", file_text(path))
    at = 0
    while at < len(text):
        if text[at].isspace() or text[at] == ";":
            at += 1
        elif text[at] == "/":
            at = _COMMENT.match(text, at).end()  # type: ignore[union-attr]
        else:
            line = ProjectLine(path, text.count("\n", 0, at) + 1)
            ends = [";"] if text[at] not in "[]&" else [";", "\n"]
            found = [end for end in (text.find(sign, at) for sign in ends) if end >= 0]
            end = min(found, default=len(text))
            yield _Command(line, text[at], text[at + 1 : end].strip(" \t"))
            at = end + 1


def _file(
    command: _Command, beside: Path, folder: Path, system: str, base_system: str, base_m: tuple[float, float, float]
) -> ProjectFile:
    where = command.line.where
    name, _, rest = command.text.partition(",")
    name = _data_file_name(name, beside)
    file = named_or_lower_case(where, f"#{name[:80]}", name, beside, folder, _SUFFIXES[0])
    if file.suffix.lower() not in _SUFFIXES:
        raise InputError(f"{where}: #{name[:80]}: a project is made of .dat and .clp files")
    fixed, links = [], []
    for found in _STATION.finditer(_COMMENT.sub("", rest)):
        if found[2] is None:
            links.append(found[1])
        else:
            fixed.append(Fixed(found[1], _place(where, found[2])))
    return ProjectFile(command.line, file, tuple(fixed), tuple(links), system, base_system, base_m)


def _data_file_name(name: str, beside: Path) -> str:
    """Return a file's name without line ends and comments; a / that parts folders is no comment."""
    whole = name.replace("\n", "").strip()
    plain = _COMMENT.sub("", name).replace("\n", "").strip()
    return whole if "/" in whole and not plain.lower().endswith(_SUFFIXES) else plain


def _place(where: str, text: str) -> tuple[float, float, float]:
    unit = text.strip()[:1].lower()
    if unit not in ("f", "m"):
        raise InputError(f"{where}: {text[:40]!r}: a place is in F (feet) or M (metres)")
    factor = _FOOT_M if unit == "f" else 1.0
    numbers = [_number(where, word) * factor for word in _NUMBER.findall(text.strip()[1:])]
    if len(numbers) != 3:
        raise InputError(f"{where}: {text[:40]!r}: want a unit and three numbers, east, north and up")
    return numbers[0], numbers[1], numbers[2]


def _base(where: str, text: str) -> tuple[str, tuple[float, float, float]]:
    """Return the zone and the place where declinations are computed; no zone if it is not stated."""
    words = [word.strip() for word in _COMMENT.sub("", text).split(",")]
    if len(words) < 4:
        return "", (0.0, 0.0, 0.0)
    east, north, up = (_number(where, word) for word in words[:3])
    return (words[3] if _zone(where, words[3]) else ""), (east, north, up)


def _zone(where: str, text: str) -> int:
    found = re.fullmatch(r"\s*([+-]?\d{1,2})\s*", _COMMENT.sub("", text))
    if found is None or abs(int(found[1])) > 60:
        raise InputError(f"{where}: {text[:40]!r} is no UTM zone, -60 to 60")
    return int(found[1])


def _number(where: str, text: str) -> float:
    try:
        value = plain_number(text)
    except ValueError:
        raise InputError(f"{where}: {text[:40]!r} is not a number") from None
    if not abs(value) <= _FARTHEST_M:
        raise InputError(f"{where}: {text[:40]!r} is not a number within {_FARTHEST_M:g}")
    return value


def utm_system(datum: str, zone: int) -> str:
    """Return `EPSG:code` of a datum and a zone, south negative; nothing if there is no code for them."""
    name = " ".join(datum.upper().split())
    for first, last, code in _ZONES.get(name, ()):
        if zone and first <= zone <= last:
            return f"EPSG:{code + abs(zone)}"
    return ""
