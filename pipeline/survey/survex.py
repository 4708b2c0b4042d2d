"""Reader of Survex data (.svx): shots adjusted to places, passage data to legs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.survey.adjustment import Shot, adjust_network
from pipeline.survey.legs import Chain, SurveyLeg, legs_of_chains
from pipeline.survey.shapes import read_text_bytes

_MAX_FILES, _MAX_SHOTS, _MAX_DEPTH = 200, 200_000, 100
_NORMAL = ("from", "to", "tape", "compass", "clino")
_SAME = {"length": "tape", "bearing": "compass", "gradient": "clino", "backbearing": "backcompass",
         "backgradient": "backclino", "dx": "easting", "dy": "northing", "dz": "altitude"}  # fmt: skip
_KNOWN = {*_NORMAL, "backcompass", "backclino", "easting", "northing", "altitude", "station", "left", "right", "up",
          "down", "ignore", "ignoreall", "newline", "direction"}  # fmt: skip
_UNITS = {"metres": 1.0, "meters": 1.0, "metric": 1.0, "feet": 0.3048, "yards": 0.9144,
          "degrees": 1.0, "degs": 1.0, "grads": 0.9, "mils": 0.9, "minutes": 1 / 60, "quadrants": 90.0}  # fmt: skip
_QUIET = {"title", "date", "team", "instrument", "copyright", "entrance", "export", "infer", "ref", "require", "sd",
          "set", "solve", "truncate", "flags", "cs", "default", "alias"}  # fmt: skip
_UPRIGHT = {"up": 90.0, "u": 90.0, "+v": 90.0, "down": -90.0, "d": -90.0, "-v": -90.0, "level": 0.0, "h": 0.0}


@dataclass
class _Settings:
    """What `*begin` opens and `*end` gives back."""

    prefix: str = ""
    style: str = "normal"
    order: tuple[str, ...] = _NORMAL
    scale: dict[str, float] = field(default_factory=dict)  # of a reading's unit
    zero: dict[str, float] = field(default_factory=dict)
    factor: dict[str, float] = field(default_factory=dict)
    declination_deg: float = 0.0
    lower: bool = True


@dataclass
class _Survey:
    """What the files say."""

    shots: list[Shot] = field(default_factory=list)
    fixed: dict[str, np.ndarray] = field(default_factory=dict)
    equal: list[tuple[str, str]] = field(default_factory=list)
    passages: list[list[tuple[str, tuple[float, float]]]] = field(default_factory=list)
    crs: str | None = None


def read_svx(path: Path) -> tuple[list[SurveyLeg], str | None]:
    """Read a Survex survey with passage data (LRUD).

    Returns
    -------
    list of SurveyLeg
        One for each `*data passage` block; metres, x east, y north, in the frame of the fixed stations.
    str or None
        The system that `*cs` names.

    Raises
    ------
    InputError
        Naming file, line and value.

    References
    ----------
    Survex manual, "Survex data files". Loops are closed by least squares, a shot's variance growing with its length.
    """
    survey = _Survey()
    _read(path, path.parent.resolve(), _Settings(), survey, [path])
    places = adjust_network(path, survey.shots, survey.fixed, survey.equal)
    chains: list[Chain] = []
    for block in survey.passages:
        lost = [name for name, _ in block if name not in places]
        if lost:
            raise InputError(f"{path}: station {lost[0]} has passage data, and no shot leads to it")
        chains.append([(n, (float(places[n][0]), float(places[n][1])), sides) for n, sides in block])
    return legs_of_chains(path, _joined_names(chains)), survey.crs


def svx_files(path: Path) -> list[Path]:
    """Return a survey's files: itself and all that it includes."""
    files = [path]
    _read(path, path.parent.resolve(), _Settings(), _Survey(), files)
    return files


def _read(path: Path, room: Path, settings: _Settings, survey: _Survey, files: list[Path]) -> None:
    stack: list[tuple[str, _Settings]] = []
    block: list[tuple[str, tuple[float, float]]] | None = None
    pending: str | None = None
    for number, words in _lines(path):
        where = f"{path}:{number}"
        if words[0].startswith("*"):
            command, rest = words[0][1:].lower(), words[1:]
            pending = None
            match command:
                case "begin":
                    if len(stack) >= _MAX_DEPTH:
                        raise InputError(f"{where}: *begin {_MAX_DEPTH} deep")
                    stack.append((rest[0].lower() if rest else "", settings))
                    settings = replace(settings, prefix=_name(settings, rest[0]) if rest else settings.prefix)
                case "end":
                    block = None
                    if not stack or (rest and rest[0].lower() != stack[-1][0]):
                        raise InputError(f"{where}: *end {' '.join(rest)} closes no *begin")
                    settings = stack.pop()[1]
                case "include":
                    _include(where, path, room, " ".join(rest), settings, survey, files)
                case "data":
                    settings = _data(where, rest, settings)
                    block = [] if settings.style == "passage" else None
                    if block is not None:
                        survey.passages.append(block)
                case "equate":
                    names = [_name(settings, word) for word in rest]
                    survey.equal += [(names[0], name) for name in names[1:]]
                case "fix":
                    _fix(where, rest, settings, survey)
                case "cs":
                    _system(where, rest, survey)
                case "units":
                    settings = _units(where, rest, settings)
                case "calibrate":
                    settings = _calibrate(where, rest, settings)
                case "declination":
                    auto = bool(rest) and rest[0].lower() == "auto"  # needs a model of the earth's field: left at 0
                    angle = 0.0 if auto else _number(where, rest[0] if rest else "")
                    turned = angle * (_unit(where, rest[1]) if len(rest) > 1 and not auto else 1.0)
                    settings = replace(settings, declination_deg=turned)
                case "case":
                    settings = replace(settings, lower=bool(rest) and rest[0].lower() == "tolower")
                case _ if command not in _QUIET:
                    raise InputError(f"{where}: *{command[:30]} is not understood")
        elif settings.style == "passage":
            if block is None:  # the style that *end gives back goes on with a block of its own
                survey.passages.append(block := [])
            values = dict(zip(settings.order, words, strict=False))
            if "station" not in values:
                raise InputError(f"{where}: passage data without a station")
            sides = _wall(where, values.get("left"), settings), _wall(where, values.get("right"), settings)
            block.append((_name(settings, values["station"]), sides))
        elif settings.style != "nosurvey":
            pending = _shot(where, words, settings, survey, pending)
    if stack:
        raise InputError(f"{path}: *begin {stack[-1][0]} is not closed")


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(read_text_bytes(path).decode("utf-8", "replace").splitlines(), start=1):
        text = line.partition(";")[0].strip()
        if text.startswith("*"):
            text = "*" + text[1:].lstrip()
        words = text.split()
        if words and words != ["*"]:
            yield number, words


def _include(
    where: str, path: Path, room: Path, name: str, settings: _Settings, survey: _Survey, files: list[Path]
) -> None:
    name = name.strip('"').replace("\\", "/")
    options = [path.parent / name, (path.parent / name).with_name(Path(name).name + ".svx")]
    file = next((option for option in options if option.is_file()), None)
    if file is None:
        raise InputError(f"{where}: *include {name[:80]!r}: no such file")
    if not file.resolve().is_relative_to(room):
        raise InputError(f"{where}: *include {name[:80]!r} leads out of the survey's folder")
    if file in files or len(files) >= _MAX_FILES:
        raise InputError(f"{where}: *include {name[:80]!r}: included before, or more than {_MAX_FILES} files")
    files.append(file)
    _read(file, room, replace(settings), survey, files)


def _name(settings: _Settings, word: str) -> str:
    word = word.removeprefix("\\").lower() if settings.lower else word.removeprefix("\\")
    return f"{settings.prefix}.{word}" if settings.prefix else word


def _data(where: str, rest: list[str], settings: _Settings) -> _Settings:
    style = rest[0].lower() if rest else "default"
    if style in ("default", "ignore"):
        return replace(settings, style="normal" if style == "default" else "nosurvey", order=_NORMAL)
    if style not in ("normal", "cartesian", "passage", "nosurvey"):
        raise InputError(f"{where}: *data {style[:30]}: understood are normal, cartesian, passage and nosurvey")
    order = tuple(_SAME.get(word.lower(), word.lower()) for word in rest[1:])
    unknown = [word for word in order if word not in _KNOWN]
    if unknown and style != "nosurvey":
        raise InputError(f"{where}: *data {style}: reading {unknown[0][:30]!r} is not understood")
    return replace(settings, style=style, order=order or settings.order)


def _shot(where: str, words: list[str], settings: _Settings, survey: _Survey, pending: str | None) -> str | None:
    """Take in one line of shots; return the station that the next line of an interleaved list goes on from."""
    if len(survey.shots) >= _MAX_SHOTS:
        raise InputError(f"{where}: more than {_MAX_SHOTS} shots")
    order = settings.order
    if "newline" in order:
        at = order.index("newline")
        if len(words) == 1:  # a station's own line
            name = _name(settings, words[0])
            if pending is not None and " " in pending:
                start, _, shot = pending.partition(" ")
                _add_shot(where, start, name, dict(zip(order[at + 1 :], shot.split(), strict=False)), settings, survey)
            return name
        return f"{pending} {' '.join(words)}" if pending is not None else None
    values = dict(zip(order, words, strict=False))
    missing = [name for name in ("from", "to") if name not in values]
    if missing:
        raise InputError(f"{where}: no `{missing[0]}` in {' '.join(words)[:60]!r} (*data normal {' '.join(order)})")
    if not {values["from"], values["to"]} & {".", "..", "...", "-"}:  # a splay ends at no station
        names = _name(settings, values["from"]), _name(settings, values["to"])
        _add_shot(where, *names, values, settings, survey)
    return None


def _add_shot(where: str, start: str, end: str, values: dict[str, str], settings: _Settings, survey: _Survey) -> None:
    if settings.style == "cartesian":
        step = np.array([_reading(where, values, key, settings) for key in ("easting", "northing", "altitude")])
    else:
        length = _reading(where, values, "tape", settings)
        clino = _angle(where, values, "clino", "backclino", settings)
        upright = abs(abs(clino) - 90.0) < 1e-9 or length == 0
        compass = (
            0.0 if upright else _angle(where, values, "compass", "backcompass", settings) + settings.declination_deg
        )
        flat = length * math.cos(math.radians(clino))
        bearing = math.radians(compass)
        step = np.array([flat * math.sin(bearing), flat * math.cos(bearing), length * math.sin(math.radians(clino))])
    if start == end:
        raise InputError(f"{where}: a shot from {start} to itself")
    survey.shots.append((start, end, step, max(float(np.linalg.norm(step)), 0.1)))


def _reading(where: str, values: dict[str, str], key: str, settings: _Settings) -> float:
    text = values.get(key)
    if text is None:
        raise InputError(f"{where}: no {key} in the shot")
    value = _number(where, text) * settings.scale.get(key, 1.0) - settings.zero.get(key, 0.0)
    return value * settings.factor.get(key, 1.0)


def _angle(where: str, values: dict[str, str], key: str, back: str, settings: _Settings) -> float:
    """Return an angle in degrees from its reading, the one looking back, or both."""
    fore = values.get(key, "-").lower()
    if fore in _UPRIGHT and key == "clino":
        return _UPRIGHT[fore]
    found = [_reading(where, values, key, settings)] if fore != "-" else []
    if values.get(back, "-") != "-":
        behind = _reading(where, values, back, settings)
        turned = -behind if key == "clino" else behind + 180.0
        found.append(found[0] + (turned - found[0] + 180.0) % 360.0 - 180.0 if found else turned)
    if not found and key == "compass":
        raise InputError(f"{where}: no compass reading in the shot")
    return float(np.mean(found)) if found else 0.0


def _wall(where: str, text: str | None, settings: _Settings) -> float:
    if text is None or text == "-":
        return math.nan
    value = _number(where, text) * settings.scale.get("left", 1.0)
    if value < 0:
        raise InputError(f"{where}: a distance of {value:g} m to a wall is negative")
    return value


def _system(where: str, rest: list[str], survey: _Survey) -> None:
    name = " ".join(rest)
    if not rest or rest[0].lower() == "out":
        return
    if rest[0].lower() in ("long-lat", "lat-long"):
        raise InputError(f"{where}: *cs {name}: stations fixed in degrees are not read; state them in a metric system")
    if survey.crs not in (None, name) and survey.fixed:
        raise InputError(f"{where}: *cs {name[:40]} after stations fixed in {survey.crs}; one system is read")
    survey.crs = name


def _fix(where: str, rest: list[str], settings: _Settings, survey: _Survey) -> None:
    numbers = [word for word in rest[1:] if word.lower() != "reference"]
    place = [_number(where, word) for word in numbers[:3]] or [0.0, 0.0, 0.0]
    if not rest or len(place) != 3:
        raise InputError(f"{where}: want *fix station east north up")
    survey.fixed[_name(settings, rest[0])] = np.array(place)


_QUANTITIES = {"tape": ("tape",), "length": ("tape",), "compass": ("compass",), "declination": (),
               "bearing": ("compass",), "clino": ("clino",),
               "gradient": ("clino",),
               "backcompass": ("backcompass",), "backclino": ("backclino",),
               "position": ("easting", "northing", "altitude"), "left": ("left",), "right": ("left",), "up": (),
               "down": (), "default": ()}  # fmt: skip


def _quantities(where: str, words: list[str]) -> tuple[list[str], list[str]]:
    """Split a command's words into the readings that it names and the rest."""
    count = next((i for i, word in enumerate(words) if word.lower() not in _QUANTITIES), len(words))
    if count == 0:
        raise InputError(f"{where}: {' '.join(words)[:60]!r} names no reading that is understood")
    return [key for word in words[:count] for key in _QUANTITIES[word.lower()]], words[count:]


def _units(where: str, rest: list[str], settings: _Settings) -> _Settings:
    if [word.lower() for word in rest] == ["default"]:
        return replace(settings, scale={})
    keys, words = _quantities(where, rest)
    factor = _number(where, words[0]) if len(words) > 1 else 1.0
    if words and words[-1].lower() == "percent":
        raise InputError(f"{where}: gradients in percent are not understood; use degrees")
    return replace(
        settings, scale={**settings.scale, **dict.fromkeys(keys, factor * _unit(where, words[-1] if words else ""))}
    )


def _calibrate(where: str, rest: list[str], settings: _Settings) -> _Settings:
    if rest and rest[0].lower() == "declination":  # the old way to state it: what is taken off
        return replace(settings, declination_deg=-_number(where, rest[1] if len(rest) > 1 else ""))
    if [word.lower() for word in rest] == ["default"]:
        return replace(settings, zero={}, factor={})
    keys, words = _quantities(where, rest)
    zero = _number(where, words[0] if words else "")
    unit = _unit(where, words[1]) if len(words) > 1 and words[1].lower() in _UNITS else None
    scale = _number(where, words[-1]) if len(words) > 1 + (unit is not None) else 1.0
    zeros = {key: zero * (unit if unit is not None else settings.scale.get(key, 1.0)) for key in keys}
    return replace(settings, zero={**settings.zero, **zeros}, factor={**settings.factor, **dict.fromkeys(keys, scale)})


def _unit(where: str, word: str) -> float:
    if word.lower() not in _UNITS:
        raise InputError(f"{where}: unit {word[:30]!r} is not understood")
    return _UNITS[word.lower()]


def _number(where: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{where}: {text[:40]!r} is not a number") from None
    if not math.isfinite(value) or abs(value) > 1e8:
        raise InputError(f"{where}: {text[:40]!r} is not a finite number below 1e8")
    return value


def _joined_names(chains: list[Chain]) -> list[Chain]:
    """Give stations that stand in one place one name, as equated stations do."""
    names: dict[tuple[float, float], str] = {}
    return [
        [(names.setdefault((round(x, 6), round(y, 6)), name), (x, y), sides) for name, (x, y), sides in chain]
        for chain in chains
    ]
