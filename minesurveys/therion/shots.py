"""Shots and cross-sections of a Therion centreline, as lines of Survex data."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from minesurveys.errors import InputError
from minesurveys.survex.survex_text import PASSAGE, SurvexText
from minesurveys.therion.lines import TherionLine
from minesurveys.therion.quantities import Quantities
from minesurveys.therion.words import number_for_survex, station_for_survex

_NAMES = {
    "tape": "length", "bearing": "compass", "gradient": "clino", "backbearing": "backcompass",
    "backgradient": "backclino", "dx": "easting", "dy": "northing", "dz": "altitude", "ceiling": "up", "floor": "down",
    "backtape": "backlength", "fromcounter": "fromcount", "tocounter": "tocount", "counter": "count",
}  # fmt: skip
_STYLES = {"normal", "cartesian", "diving", "cylpolar", "nosurvey", "dimensions", "passage", "topofil"}
_LRUD = ("left", "right", "up", "down")
_ANGLES = ("compass", "backcompass")
_NO_NUMBERS = ("from", "to", "ignore", "ignoreall", "direction")
_READINGS = {
    "from", "to", "station", "newline", "length", "compass", "clino", "backcompass", "backclino", "easting", "northing",
    "altitude", "fromdepth", "todepth", "depth", "depthchange", "ignore", "ignoreall", "direction", "fromcount",
    "tocount", "count", "backlength", *_LRUD,
}  # fmt: skip
_PLUMB = {"up", "u", "+v", "down", "d", "-v", "level", "h", "-", "."}
_SPLAY_ENDS = ("-", ".")
_UNKNOWN = ("-", ".", "nan", "NaN", "NAN")
_DEFAULT = ("data", "normal", "from", "to", "length", "compass", "clino")
_VECTOR = {"dx": "easting", "dy": "northing", "dz": "altitude"}  # the quantity of each reading
_TURNED = "*data cylpolar from to tape compass depthchange"
_PLAIN_UNITS = ("*units length metres", "*units compass degrees", "*units depth metres")
_UNCORRECTED = ("*calibrate length 0", "*calibrate compass 0", "*calibrate depth 0")


@dataclass
class _TherionShot:
    line: TherionLine
    values: dict[str, str]
    flags: frozenset[str]


@dataclass(frozen=True)
class ReadingOrder:
    """How lines are read: the style, the readings in order, what stands around names of stations, and flags."""

    style: str = ""
    readings: tuple[str, ...] = ()
    around: tuple[str, str] = ("", "")
    flags: frozenset[str] = frozenset()


class Shots:
    """The data of one centreline. Repeated shots are collected and averaged; cross-sections follow their shots."""

    def __init__(self, made: SurvexText, is_turned: bool) -> None:
        """Begin without an order of readings. Vectors are turned by a declination, as in Therion, if `is_turned`."""
        self.made, self.add = made, made.add
        self.how = ReadingOrder()
        self.is_turned = is_turned
        self.quantities = Quantities()
        self.written: frozenset[str] | None = frozenset()  # flags that Survex has; None: it is not known which
        self.repeated: list[_TherionShot] = []
        self.sections: list[tuple[TherionLine, str]] = []  # `*data` lines and rows of cross-sections
        self.tail = ""  # the last station of the cross-sections' passage

    @property
    def style(self) -> str:
        """Return the style of the readings, empty before the first `data` line."""
        return self.how.style

    @property
    def readings(self) -> tuple[str, ...]:
        """Return the readings of a line, in order."""
        return self.how.readings

    def station(self, where: str, name: str) -> str:
        """Return a station's name for Survex."""
        before, after = self.how.around
        own = name not in _SPLAY_ENDS and "@" not in name
        return station_for_survex(where, f"{before}{name}{after}" if own else name)

    def begin_group(self) -> tuple[ReadingOrder, Quantities]:
        """Return what the end of a group takes back."""
        kept = self.how, self.quantities
        self.quantities = self.quantities.copy()
        return kept

    def end_group(self, kept: tuple[ReadingOrder, Quantities]) -> None:
        """Take back what a group stated, as Survex does at the end of its block."""
        (self.how, self.quantities), self.written = kept, None

    def order(self, line: TherionLine) -> None:
        """Read a `data` line: the style and the order of the readings."""
        words = [word.lower() for word in line.words[1:]]
        if not words or words[0] not in _STYLES:
            raise InputError(f"{line.where}: data {' '.join(words)[:60]!r} is not supported")
        style = "normal" if words[0] == "topofil" else words[0]
        self.how = replace(self.how, style=style, readings=tuple(_NAMES.get(word, word) for word in words[1:]))
        unknown = [word for word in self.readings if word not in _READINGS]
        if unknown:
            raise InputError(f"{line.where}: reading {unknown[0][:40]!r} is not supported")
        if self.style in ("dimensions", "passage"):
            if "station" not in self.readings:
                raise InputError(f"{line.where}: dimensions without a station")
            self.add(line, PASSAGE)
        else:
            self.add(line, self._order())

    def read(self, line: TherionLine) -> None:
        """Read a line of data."""
        if not self.style:
            if len(line.words) < len(_DEFAULT) - 2:
                raise InputError(f"{line.where}: {line.words[0][:40]!r} is no command, and no `data` line precedes it")
            self.order(replace(line, words=_DEFAULT))  # Therion's own order
        if self.style in ("dimensions", "passage"):
            self._section(line, dict(zip(self.readings, line.words, strict=False)))
        elif "newline" in self.readings:
            alone = len(line.words) == 1
            words = [self.station(line.where, line.words[0])] if alone else [self._plain(line, w) for w in line.words]
            self._put_flags(line, self.how.flags)
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
        if self._is_vector():
            return _TURNED
        kept = [word for word in self.readings if word not in _LRUD]
        return f"*data {self.style} {' '.join(kept)}"

    def _is_vector(self) -> bool:
        """Return whether shots are vectors that the declination turns.

        Survex turns polar readings only: findings/therion-declination-turns-vectors.sh.
        """
        return self.is_turned and self.style == "cartesian" and {"from", "to", *_VECTOR.values()} <= set(self.readings)

    def _shot(self, line: TherionLine) -> None:
        if "from" not in self.readings or "to" not in self.readings:
            raise InputError(f"{line.where}: a shot, but `data {self.style}` names no from and to")
        values = dict(zip(self.readings, line.words, strict=False))
        if len(line.words) < len([word for word in self.readings if word not in ("ignoreall", *_LRUD)]):
            raise InputError(f"{line.where}: {len(line.words)} readings, `data` names {len(self.readings)}")
        if len(line.words) > len(self.readings) and "ignoreall" not in self.readings:
            raise InputError(f"{line.where}: {len(line.words)} readings, `data` names {len(self.readings)}")
        shot = _TherionShot(line, values, self.how.flags)
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
        """Write the readings of one shot, of which each has its mean. It has the flags that all of them have."""
        if not self.repeated:
            return
        shots, self.repeated = self.repeated, []
        line, rows = shots[0].line, [shot.values for shot in shots]
        self._put_flags(line, frozenset.intersection(*(shot.flags for shot in shots)))
        means = {
            name: _mean(line, name, texts)
            for name in self.readings
            if name not in (*_LRUD, *_NO_NUMBERS) and (texts := [row[name] for row in rows if name in row])
        }
        ends = {name: self.station(line.where, rows[0][name]) for name in ("from", "to")}
        if self._is_vector():
            self._write_vector(line, ends, means)
            return
        words = []
        for name in (word for word in self.readings if word not in _LRUD):
            if name in ends:
                words.append(ends[name])
            elif name in _NO_NUMBERS:
                words.append(rows[0][name] if rows[0].get(name, "").isalnum() else "0")
            else:
                words.append(means[name])
        is_splay = rows[0].get("from") in _SPLAY_ENDS or rows[0].get("to") in _SPLAY_ENDS
        if self.style == "normal" or not is_splay:
            self.add(line, " ".join(words))
            return
        words = [self.made.unnamed_station() if word in (".", "..") else word for word in words]
        for text in ("*begin", "*flags splay", " ".join(words), "*end"):
            self.add(line, text)

    def _write_vector(self, line: TherionLine, ends: dict[str, str], means: dict[str, str]) -> None:
        """Write a vector as its length and bearing in plan, m and deg, and its rise, whatever the units of these."""
        metres = self.quantities.metres
        east, north, rise = (metres(axis, float(means[name])) for axis, name in _VECTOR.items())
        bearing = math.degrees(math.atan2(east, north)) % 360
        is_splay = any(name in (".", "..") for name in ends.values())
        names = [self.made.unnamed_station() if name in (".", "..") else name for name in ends.values()]
        texts = ("*begin", *(("*flags splay",) if is_splay else ()), *_PLAIN_UNITS, *_UNCORRECTED)
        for text in (*texts, f"{' '.join(names)} {math.hypot(east, north):.6f} {bearing:.8f} {rise:.6f}", "*end"):
            self.add(line, text)

    def _put_flags(self, line: TherionLine, flags: frozenset[str]) -> None:
        """State flags to Survex, if they are other ones than before."""
        if flags != self.written:
            self.made.add_flags(line, flags)
            self.written = flags

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
            self.sections += [(line, PASSAGE), (line, self._section_words(line, values["from"], at_from))]
        self.sections.append((line, self._section_words(line, values["to"], at_to)))
        self.tail = values["to"]

    def _section(self, line: TherionLine, values: dict[str, str]) -> None:
        self.add(line, self._section_words(line, values["station"], values))

    def _section_words(self, line: TherionLine, station: str, values: dict[str, str]) -> str:
        walls = []
        for name in _LRUD:
            text = values.get(name, "-")
            walls.append("-" if text in _UNKNOWN else number_for_survex(line.where, text))
        return " ".join([self.station(line.where, station), *walls])

    def _plain(self, line: TherionLine, word: str) -> str:
        """Return a word of interleaved data: a number, a plumb reading, or a station."""
        if word.lower() in _PLUMB:
            return word
        try:
            return number_for_survex(line.where, word)
        except InputError:
            return self.station(line.where, word)


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
