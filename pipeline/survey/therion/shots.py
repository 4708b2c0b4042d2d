"""Shots and cross-sections of a Therion centreline, as lines of Survex data."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pipeline.errors import InputError
from pipeline.survey.solved.survex_text import SurvexText
from pipeline.survey.therion.lines import TherionLine
from pipeline.survey.therion.words import number_for_survex, station_for_survex

_NAMES = {
    "tape": "length", "bearing": "compass", "gradient": "clino", "backbearing": "backcompass",
    "backgradient": "backclino", "dx": "easting", "dy": "northing", "dz": "altitude", "ceiling": "up", "floor": "down",
    "backtape": "backlength", "fromcounter": "fromcount", "tocounter": "tocount", "counter": "count",
}  # fmt: skip
_STYLES = {"normal", "cartesian", "diving", "cylpolar", "nosurvey", "dimensions", "passage", "topofil"}
_PASSAGE = "*data passage station left right up down"
_LRUD = ("left", "right", "up", "down")
_ANGLES = ("compass", "backcompass")
_READINGS = {
    "from", "to", "station", "newline", "length", "compass", "clino", "backcompass", "backclino", "easting", "northing",
    "altitude", "fromdepth", "todepth", "depth", "depthchange", "ignore", "ignoreall", "direction", "fromcount",
    "tocount", "count", "backlength", *_LRUD,
}  # fmt: skip
_PLUMB = {"up", "u", "+v", "down", "d", "-v", "level", "h", "-", "."}
_SPLAY_ENDS = ("-", ".")
_UNKNOWN = ("-", ".", "nan", "NaN", "NAN")


@dataclass
class _TherionShot:
    line: TherionLine
    values: dict[str, str]


class Shots:
    """The data of one centreline. Repeated shots are collected and averaged; cross-sections follow their shots."""

    def __init__(self, made: SurvexText) -> None:
        """Begin without an order of readings."""
        self.made, self.add = made, made.add
        self.style = ""
        self.readings: tuple[str, ...] = ()
        self.repeated: list[_TherionShot] = []
        self.sections: list[tuple[TherionLine, str]] = []  # `*data` lines and rows of cross-sections
        self.tail = ""  # the last station of the cross-sections' passage

    def order(self, line: TherionLine) -> None:
        """Read a `data` line: the style and the order of the readings."""
        words = [word.lower() for word in line.words[1:]]
        if not words or words[0] not in _STYLES:
            raise InputError(f"{line.where}: data {' '.join(words)[:60]!r} is not supported")
        self.style = "normal" if words[0] == "topofil" else words[0]
        self.readings = tuple(_NAMES.get(word, word) for word in words[1:])
        unknown = [word for word in self.readings if word not in _READINGS]
        if unknown:
            raise InputError(f"{line.where}: reading {unknown[0][:40]!r} is not supported")
        if self.style in ("dimensions", "passage"):
            if "station" not in self.readings:
                raise InputError(f"{line.where}: dimensions without a station")
            self.add(line, _PASSAGE)
        else:
            self.add(line, self._order())

    def read(self, line: TherionLine) -> None:
        """Read a line of data."""
        if not self.style:
            raise InputError(f"{line.where}: {line.words[0][:40]!r} is no command, and no `data` line precedes it")
        if self.style in ("dimensions", "passage"):
            self._section(line, dict(zip(self.readings, line.words, strict=False)))
        elif "newline" in self.readings:
            alone = len(line.words) == 1
            words = [station_for_survex(line.where, line.words[0])] if alone else [_plain(line, w) for w in line.words]
            self.add(line, " ".join(words))
        else:
            self._shot(line)

    def flush(self) -> None:
        """Write what was collected: the last shot, and the cross-sections that stood in shot lines."""
        self._write_repeated()
        if not self.sections:
            return
        self.tail = ""
        for line, text in self.sections:
            self.add(line, text)
        self.add(line, self._order())
        self.sections = []

    def _order(self) -> str:
        kept = [word for word in self.readings if word not in _LRUD]
        return f"*data {self.style} {' '.join(kept)}"

    def _shot(self, line: TherionLine) -> None:
        if "from" not in self.readings or "to" not in self.readings:
            raise InputError(f"{line.where}: a shot, but `data {self.style}` names no from and to")
        values = dict(zip(self.readings, line.words, strict=False))
        if len(line.words) < len([word for word in self.readings if word not in ("ignoreall", *_LRUD)]):
            raise InputError(f"{line.where}: {len(line.words)} readings, `data` names {len(self.readings)}")
        if len(line.words) > len(self.readings) and "ignoreall" not in self.readings:
            raise InputError(f"{line.where}: {len(line.words)} readings, `data` names {len(self.readings)}")
        shot = _TherionShot(line, values)
        splay = values.get("from") in _SPLAY_ENDS or values.get("to") in _SPLAY_ENDS
        ends = values.get("from"), values.get("to")
        if self.repeated and (splay or (self.repeated[0].values["from"], self.repeated[0].values["to"]) != ends):
            self._write_repeated()
        self.repeated.append(shot)
        if splay:
            self._write_repeated()
        elif len(self.repeated) == 1 and any(name in values for name in _LRUD):
            self._keep_section(line, values)

    def _write_repeated(self) -> None:
        if not self.repeated:
            return
        line = self.repeated[0].line
        rows = [shot.values for shot in self.repeated]
        words = []
        for name in (word for word in self.readings if word not in _LRUD):
            texts = [row[name] for row in rows if name in row]
            if name in ("from", "to"):
                words.append(station_for_survex(line.where, texts[0]))
            elif name in ("ignore", "ignoreall", "direction"):
                words.append(texts[0] if texts and texts[0].isalnum() else "0")
            else:
                words.append(_mean(line, name, texts))
        self.repeated = []
        is_splay = rows[0].get("from") in _SPLAY_ENDS or rows[0].get("to") in _SPLAY_ENDS
        if self.style == "normal" or not is_splay:
            self.add(line, " ".join(words))
            return
        names = [self.made.unnamed_station() if word in (".", "..") else word for word in words]
        for text in ("*begin", "*flags splay", " ".join(names), "*end"):
            self.add(line, text)

    def _keep_section(self, line: TherionLine, values: dict[str, str]) -> None:
        """Keep the cross-sections of a shot; a shot that does not continue begins a new passage.

        As in Therion, one value belongs to the shot's second station. `[a b]` are those of both, in the order of `from`
        and `to`. The first station of a passage without a value of its own has its shot's.
        """
        at_from, at_to = {}, {}
        for name in _LRUD:
            pair = values.get(name, "-").strip("[]").split() or ["-"]
            if len(pair) > 2:
                raise InputError(f"{line.where}: {name} {values[name][:40]!r}: want one or two distances")
            ordered = pair if self.readings.index("from") < self.readings.index("to") else pair[::-1]
            at_from[name], at_to[name] = ordered[0], ordered[-1]
        if all(text in _UNKNOWN for text in (*at_from.values(), *at_to.values())):
            self.tail = ""
            return
        if values["from"] != self.tail:
            self.sections += [(line, _PASSAGE), (line, _section_words(line, values["from"], at_from))]
        self.sections.append((line, _section_words(line, values["to"], at_to)))
        self.tail = values["to"]

    def _section(self, line: TherionLine, values: dict[str, str]) -> None:
        self.add(line, _section_words(line, values["station"], values))


def _section_words(line: TherionLine, station: str, values: dict[str, str]) -> str:
    walls = []
    for name in _LRUD:
        text = values.get(name, "-")
        walls.append("-" if text in _UNKNOWN else number_for_survex(line.where, text))
    return " ".join([station_for_survex(line.where, station), *walls])


def _plain(line: TherionLine, word: str) -> str:
    """Return a word of interleaved data: a number, a plumb reading, or a station."""
    if word.lower() in _PLUMB:
        return word
    try:
        return number_for_survex(line.where, word)
    except InputError:
        return station_for_survex(line.where, word)


def _mean(line: TherionLine, name: str, texts: list[str]) -> str:
    """Return one reading, or the mean of several: of angles of the compass, the direction of their mean vector."""
    if len(texts) == 1 or any(text.lower() in _PLUMB or text in _UNKNOWN for text in texts):
        text = next((text for text in texts if text not in _UNKNOWN), "-")
        return text if text.lower() in _PLUMB else number_for_survex(line.where, text)
    numbers = [float(number_for_survex(line.where, text)) for text in texts]
    if name in _ANGLES and max(numbers) - min(numbers) > 180:
        numbers = [number - 360 if number > 180 else number for number in numbers]
        mean = math.fmod(sum(numbers) / len(numbers) + 360, 360)
        return f"{mean:.4f}"
    return f"{sum(numbers) / len(numbers):.6f}"
