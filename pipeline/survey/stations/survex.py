"""Reader of Survex data (.svx): read shots and passage data, adjust the shots, and build legs."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.guard.plain_file import require_at_most
from pipeline.params.reader_limits import FILE, reader_limits
from pipeline.survey.passages.legs import Chain, SurveyLeg, legs_of_chains
from pipeline.survey.solved.project_files import plain_lines, readable
from pipeline.survey.stations.adjustment import Shot, adjust_network
from pipeline.survey.stations.survex_readings import (
    Settings,
    angle_deg,
    calibrated,
    number_of,
    order_of_data,
    reading,
    require_no_more,
    unit_size,
    wall_m,
    with_units,
)

_IGNORED_COMMANDS = {
    "title",
    "date",
    "team",
    "instrument",
    "copyright",
    "entrance",
    "export",
    "infer",
    "ref",
    "require",
    "sd",
    "solve",
    "flags",
    "alias",
}


class NoPassagesError(InputError):
    """A survey that has shots, but no cross-sections."""


@dataclass
class _Survey:
    """The content of all files of a survey."""

    shots: list[Shot] = field(default_factory=list)
    fixed: dict[str, np.ndarray] = field(default_factory=dict)
    equal: list[tuple[str, str]] = field(default_factory=list)
    passages: list[list[tuple[str, tuple[float, float]]]] = field(default_factory=list)
    stations: int = 0  # in all passages
    crs: str | None = None


def read_svx(path: Path) -> tuple[list[SurveyLeg], str | None]:
    """Read a Survex survey with passage data (LRUD).

    Returns
    -------
    list of SurveyLeg
        One for each `*data passage` block, m, x east, y north, in the frame of the fixed stations.
    str or None
        The coordinate system that `*cs` names.

    Raises
    ------
    InputError
        If a line cannot be read. The message names the file, the line and the value.

    References
    ----------
    Survex manual, "Survex data files". Loops are closed by least squares; a shot's variance is proportional to its
    length.
    """
    legs, crs, _ = read_svx_rise(path)
    return legs, crs


def read_svx_rise(path: Path) -> tuple[list[SurveyLeg], str | None, float]:
    """Read a Survex survey as `read_svx`, and how far its highest passage station lies over its lowest, m."""
    survey = _Survey()
    _read(path, path.parent.resolve(), Settings(), survey, [path])
    positions = adjust_network(path, survey.shots, survey.fixed, survey.equal)
    if not any(survey.passages):
        raise NoPassagesError(f"{path}: no legs with passages; widths left and right of the stations are needed")
    chains: list[Chain] = []
    for block in survey.passages:
        unknown = [name for name, _ in block if name not in positions]
        if unknown:
            raise InputError(f"{path}: station {unknown[0]} has passage data, but no shot leads to it")
        chains.append([(n, (float(positions[n][0]), float(positions[n][1])), walls) for n, walls in block])
    heights = [float(positions[name][2]) for block in survey.passages for name, _ in block]
    rise_m = max(heights, default=0.0) - min(heights, default=0.0)
    return legs_of_chains(path, _joined_names(chains)), survey.crs, rise_m


def svx_files(path: Path) -> list[Path]:
    """Return a survey's files: the file and all files that it includes."""
    files = [path]
    _read(path, path.parent.resolve(), Settings(), _Survey(), files)
    return files


def _read(path: Path, folder: Path, settings: Settings, survey: _Survey, files: list[Path]) -> None:
    stack: list[tuple[str, Settings]] = []
    block: list[tuple[str, tuple[float, float]]] | None = None
    pending: str | None = None
    for number, words in _lines(path):
        where = f"{path}:{number}"
        if words[0].startswith("*"):
            command, rest = words[0][1:].lower(), words[1:]
            pending = None
            match command:
                case "begin":
                    if len(stack) >= reader_limits().survex_depth:
                        most = reader_limits().survex_depth
                        raise InputError(f"{where}: *begin is nested more than {most} deep (survex_depth in {FILE})")
                    stack.append((rest[0].lower() if rest else "", settings))
                    settings = replace(settings, prefix=_name(settings, rest[0]) if rest else settings.prefix)
                case "end":
                    block = None
                    if not stack or (rest and rest[0].lower() != stack[-1][0]):
                        raise InputError(f"{where}: *end {' '.join(rest)} closes no *begin")
                    settings = stack.pop()[1]
                case "include":
                    _include(where, path, folder, " ".join(rest), settings, survey, files)
                case "data":
                    settings = order_of_data(where, rest, settings)
                    block = [] if settings.style == "passage" else None
                    if block is not None:
                        survey.passages.append(block)
                case "equate":
                    names = [_name(settings, word) for word in rest]
                    survey.equal += [(names[0], name) for name in names[1:]]
                    require_at_most(path, len(survey.equal), "survex_shots", "equates or more")
                case "fix":
                    _fix(where, rest, settings, survey)
                case "cs":
                    _system(where, rest, survey)
                case "units":
                    settings = with_units(where, rest, settings)
                case "calibrate":
                    settings = calibrated(where, rest, settings)
                case "declination":
                    auto = (
                        bool(rest) and rest[0].lower() == "auto"
                    )  # a model of the earth's magnetic field is missing: 0 is used
                    angle = 0.0 if auto else number_of(where, rest[0] if rest else "")
                    turned = angle * (unit_size(where, rest[1]) if len(rest) > 1 and not auto else 1.0)
                    settings = replace(settings, declination_deg=turned)
                case "case":  # capital letters only are as one case only
                    settings = replace(settings, lower=bool(rest) and rest[0].lower() in ("tolower", "toupper"))
                case "set" if [word.lower() for word in rest[:1]] == ["names"]:
                    pass
                case _ if command not in _IGNORED_COMMANDS:
                    raise InputError(f"{where}: *{command[:30]} is not supported")
        elif settings.style == "passage":
            if block is None:  # *end has restored the passage style: begin a new block
                survey.passages.append(block := [])
            require_no_more(where, words, settings)
            values = dict(zip(settings.order, words, strict=False))
            if "station" not in values:
                raise InputError(f"{where}: passage data without a station")
            walls = wall_m(where, values.get("left"), settings), wall_m(where, values.get("right"), settings)
            block.append((_name(settings, values["station"]), walls))
            survey.stations += 1
            require_at_most(path, survey.stations, "stations", "stations with passages or more")
        elif settings.style != "nosurvey":
            pending = _shot(where, words, settings, survey, pending)
    if stack:
        raise InputError(f"{path}: *begin {stack[-1][0]} is not closed")


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    for number, line in plain_lines(path):
        text = readable(line).partition(";")[0].strip(" \t")
        if text.startswith("*"):
            text = "*" + text[1:].lstrip(" \t")
        words = [word for word in re.split("[ \t]+", text) if word]
        if words and words != ["*"]:
            yield number, words


def _include(
    where: str, path: Path, folder: Path, name: str, settings: Settings, survey: _Survey, files: list[Path]
) -> None:
    name = name.strip('"').replace("\\", "/")
    if not name.isprintable():
        raise InputError(f"{where}: *include {name[:80]!r} holds control characters")
    options = [path.parent / name, (path.parent / name).with_name(Path(name).name + ".svx")]
    file = next((option for option in options if option.is_file()), None)
    if file is None:
        raise InputError(f"{where}: *include {name[:80]!r}: no such file")
    if not file.resolve().is_relative_to(folder):
        raise InputError(f"{where}: *include {name[:80]!r} is outside the survey's folder")
    most = reader_limits().survex_files
    if file in files or len(files) >= most:
        raise InputError(
            f"{where}: *include {name[:80]!r}: already included, or more than {most} files (survex_files in {FILE})"
        )
    files.append(file)
    _read(file, folder, replace(settings), survey, files)


def _name(settings: Settings, word: str) -> str:
    word = word.removeprefix("\\").lower() if settings.lower else word.removeprefix("\\")
    return f"{settings.prefix}.{word}" if settings.prefix else word


def _shot(where: str, words: list[str], settings: Settings, survey: _Survey, pending: str | None) -> str | None:
    """Add the shot of one line. In an interleaved list, return the station where the next line's shot begins."""
    if len(survey.shots) >= reader_limits().survex_shots:
        raise InputError(f"{where}: more than {reader_limits().survex_shots} shots (survex_shots in {FILE})")
    order = settings.order
    if "newline" in order:
        newline = order.index("newline")
        if len(words) == 1:  # the line of a station
            name = _name(settings, words[0])
            if pending is not None and " " in pending:
                start, _, shot = pending.partition(" ")
                _add_shot(
                    where, start, name, dict(zip(order[newline + 1 :], shot.split(), strict=False)), settings, survey
                )
            return name
        return f"{pending} {' '.join(words)}" if pending is not None else None
    require_no_more(where, words, settings)
    values = dict(zip(order, words, strict=False))
    missing = [name for name in ("from", "to") if name not in values]
    if missing:
        raise InputError(f"{where}: no `{missing[0]}` in {' '.join(words)[:60]!r} (*data normal {' '.join(order)})")
    if not {values["from"], values["to"]} & {".", "..", "...", "-"}:  # skip splays: they have no end station
        names = _name(settings, values["from"]), _name(settings, values["to"])
        _add_shot(where, *names, values, settings, survey)
    return None


def _add_shot(where: str, start: str, end: str, values: dict[str, str], settings: Settings, survey: _Survey) -> None:
    if settings.style == "cartesian":
        step = np.array([reading(where, values, key, settings) for key in ("easting", "northing", "altitude")])
    else:
        length = reading(where, values, "tape", settings)
        clino = angle_deg(where, values, "clino", "backclino", settings)
        vertical = abs(abs(clino) - 90.0) < 1e-9 or length == 0
        compass = (
            0.0 if vertical else angle_deg(where, values, "compass", "backcompass", settings) + settings.declination_deg
        )
        level = length * math.cos(math.radians(clino))
        bearing = math.radians(compass)
        step = np.array([level * math.sin(bearing), level * math.cos(bearing), length * math.sin(math.radians(clino))])
    if start == end:
        raise InputError(f"{where}: a shot from {start} to itself")
    survey.shots.append((start, end, step, max(float(np.linalg.norm(step)), 0.1)))


def _system(where: str, rest: list[str], survey: _Survey) -> None:
    name = " ".join(rest)
    if not rest or rest[0].lower() == "out":
        return
    if rest[0].lower() in ("long-lat", "lat-long"):
        raise InputError(f"{where}: *cs {name}: degrees are not supported; use a metric coordinate system")
    if survey.crs not in (None, name) and survey.fixed:
        raise InputError(
            f"{where}: *cs {name[:40]} follows stations fixed in {survey.crs}; only one coordinate system is supported"
        )
    survey.crs = name


def _fix(where: str, rest: list[str], settings: Settings, survey: _Survey) -> None:
    numbers = [word for word in rest[1:] if word.lower() != "reference"]
    position = [number_of(where, word) for word in numbers[:3]] or [0.0, 0.0, 0.0]
    if not rest or len(position) != 3:
        raise InputError(f"{where}: expected *fix station east north up")
    name = _name(settings, rest[0])
    if name in survey.fixed and (survey.fixed[name] != position).any():
        raise InputError(f"{where}: station {name[:60]} is fixed twice, at different places")
    survey.fixed[name] = np.array(position)


def _joined_names(chains: list[Chain]) -> list[Chain]:
    """Give stations at the same position, such as equated stations, the same name."""
    names: dict[tuple[float, float], str] = {}
    return [
        [(names.setdefault((round(x, 6), round(y, 6)), name), (x, y), walls) for name, (x, y), walls in chain]
        for chain in chains
    ]
