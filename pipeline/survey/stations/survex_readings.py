"""Survex readings: the settings of a data line, and its readings in metres and degrees."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.errors import InputError
from pipeline.guard.plain_number import plain_number

_NORMAL = ("from", "to", "tape", "compass", "clino")
_SYNONYMS = {
    "length": "tape",
    "bearing": "compass",
    "gradient": "clino",
    "backbearing": "backcompass",
    "backgradient": "backclino",
    "dx": "easting",
    "dy": "northing",
    "dz": "altitude",
}
_READINGS = {
    *_NORMAL,
    "backcompass",
    "backclino",
    "easting",
    "northing",
    "altitude",
    "station",
    "left",
    "right",
    "up",
    "down",
    "ignore",
    "ignoreall",
    "newline",
    "direction",
}
_UNITS = {
    "metres": 1.0,
    "meters": 1.0,
    "metric": 1.0,
    "feet": 0.3048,
    "yards": 0.9144,
    "degrees": 1.0,
    "degs": 1.0,
    "grads": 0.9,
    "mils": 0.9,
    "minutes": 1 / 60,
    "quadrants": 90.0,
}
# What an instrument shows, m or deg; Survex only warns of other readings, which would turn or mirror a leg.
_SHOWN = {"tape": (0.0, math.inf), "compass": (0.0, 360.0), "clino": (-90.0, 90.0)}
_SHOWN |= {f"back{key}": _SHOWN[key] for key in ("compass", "clino")}
_PLUMB_DEG = {"up": 90.0, "u": 90.0, "+v": 90.0, "down": -90.0, "d": -90.0, "-v": -90.0, "level": 0.0, "h": 0.0}
_QUANTITIES = {
    "tape": ("tape",),
    "length": ("tape",),
    "compass": ("compass",),
    "bearing": ("compass",),
    "clino": ("clino",),
    "gradient": ("clino",),
    "backcompass": ("backcompass",),
    "backclino": ("backclino",),
    "position": ("easting", "northing", "altitude"),
    "left": ("left",),
    "right": ("left",),
    "declination": (),
    "up": (),
    "down": (),
    "default": (),
}


@dataclass
class Settings:
    """Settings of data lines. `*begin` saves them and `*end` restores them."""

    prefix: str = ""
    style: str = "normal"
    order: tuple[str, ...] = _NORMAL
    scale: dict[str, float] = field(default_factory=dict)  # size of a reading's unit, m or deg
    zero: dict[str, float] = field(default_factory=dict)
    factor: dict[str, float] = field(default_factory=dict)
    declination_deg: float = 0.0
    lower: bool = True


def order_of_data(where: str, rest: list[str], settings: Settings) -> Settings:
    """Return settings with the style and the order of readings that `*data` names."""
    style = rest[0].lower() if rest else "default"
    if style in ("default", "ignore"):
        return replace(settings, style="normal" if style == "default" else "nosurvey", order=_NORMAL)
    if style not in ("normal", "cartesian", "passage", "nosurvey"):
        raise InputError(f"{where}: *data {style[:30]}: not supported; use normal, cartesian, passage or nosurvey")
    order = tuple(_SYNONYMS.get(word.lower(), word.lower()) for word in rest[1:])
    unknown = [word for word in order if word not in _READINGS]
    if unknown and style != "nosurvey":
        raise InputError(f"{where}: *data {style}: reading {unknown[0][:30]!r} is not supported")
    twice = [word for word in dict.fromkeys(order) if order.count(word) > 1 and word != "ignore"]
    if twice:
        raise InputError(f"{where}: *data {style}: reading {twice[0]!r} stands twice")
    return replace(settings, style=style, order=order or settings.order)


def require_no_more(where: str, words: list[str], settings: Settings) -> None:
    """Refuse a line with more words than `*data` names readings."""
    if len(words) > len(settings.order) and "ignoreall" not in settings.order:
        raise InputError(
            f"{where}: {words[len(settings.order)][:40]!r} follows the {len(settings.order)} readings that *data names"
        )


def reading(where: str, values: dict[str, str], key: str, settings: Settings) -> float:
    """Return one reading in metres or degrees, corrected by unit, zero error and scale.

    Raises
    ------
    InputError
        If there is none, it is no number, or no instrument shows it.
    """
    text = values.get(key)
    if text is None:
        raise InputError(f"{where}: no {key} in the shot")
    shown = number_of(where, text) * settings.scale.get(key, 1.0)
    low, high = _SHOWN.get(key, (-math.inf, math.inf))
    if not low - 1e-9 <= shown <= high + 1e-9:
        raise InputError(f"{where}: {key} = {text[:40]}: want {low:g} to {high:g}, in metres or degrees")
    value = (shown - settings.zero.get(key, 0.0)) * settings.factor.get(key, 1.0)
    if key == "tape" and value < 0:
        raise InputError(f"{where}: {key} = {text[:40]}: {value:g} m with its *calibrate, want 0 or more")
    return value


def angle_deg(where: str, values: dict[str, str], key: str, back: str, settings: Settings) -> float:
    """Return an angle in degrees from the foresight, the backsight, or the mean of both."""
    fore = values.get(key, "-").lower()
    if fore in _PLUMB_DEG and key == "clino":
        return _PLUMB_DEG[fore]
    angles = [reading(where, values, key, settings)] if fore != "-" else []
    if values.get(back, "-") != "-":
        backsight = reading(where, values, back, settings)
        reversed_deg = -backsight if key == "clino" else backsight + 180.0
        angles.append(angles[0] + (reversed_deg - angles[0] + 180.0) % 360.0 - 180.0 if angles else reversed_deg)
    if not angles and key == "compass":
        raise InputError(f"{where}: no compass reading in the shot")
    return float(np.mean(angles)) if angles else 0.0


def wall_m(where: str, text: str | None, settings: Settings) -> float:
    """Return the distance to a wall, m; nan if it was not measured."""
    if text is None or text == "-":
        return math.nan
    value = number_of(where, text) * settings.scale.get("left", 1.0)
    if value < 0:
        raise InputError(f"{where}: a distance of {value:g} m to a wall is negative")
    return value


def with_units(where: str, rest: list[str], settings: Settings) -> Settings:
    """Return settings with the units that `*units` names."""
    if [word.lower() for word in rest] == ["default"]:
        return replace(settings, scale={})
    keys, words = _quantities(where, rest)
    factor = number_of(where, words[0]) if len(words) > 1 else 1.0
    if factor <= 0:
        raise InputError(f"{where}: *units {words[0][:40]}: want a factor above 0")
    if words and words[-1].lower() == "percent":
        raise InputError(f"{where}: gradients in percent are not supported; use degrees")
    return replace(
        settings, scale={**settings.scale, **dict.fromkeys(keys, factor * unit_size(where, words[-1] if words else ""))}
    )


def calibrated(where: str, rest: list[str], settings: Settings) -> Settings:
    """Return settings with the zero errors and scales that `*calibrate` names."""
    if rest and rest[0].lower() == "declination":  # the old form states the value to subtract
        return replace(settings, declination_deg=-number_of(where, rest[1] if len(rest) > 1 else ""))
    if [word.lower() for word in rest] == ["default"]:
        return replace(settings, zero={}, factor={})
    keys, words = _quantities(where, rest)
    zero = number_of(where, words[0] if words else "")
    unit = unit_size(where, words[1]) if len(words) > 1 and words[1].lower() in _UNITS else None
    scale = number_of(where, words[-1]) if len(words) > 1 + (unit is not None) else 1.0
    zeros = {key: zero * (unit if unit is not None else settings.scale.get(key, 1.0)) for key in keys}
    return replace(settings, zero={**settings.zero, **zeros}, factor={**settings.factor, **dict.fromkeys(keys, scale)})


def unit_size(where: str, word: str) -> float:
    """Return a unit's size in metres or degrees."""
    if word.lower() not in _UNITS:
        raise InputError(f"{where}: unit {word[:30]!r} is not supported")
    return _UNITS[word.lower()]


def number_of(where: str, text: str) -> float:
    """Return a finite number below 1e8.

    Raises
    ------
    InputError
        If the text is not such a number. The message names the place and the text.
    """
    try:
        value = plain_number(text)
    except ValueError:
        raise InputError(f"{where}: {text[:40]!r} is not a number") from None
    if not math.isfinite(value) or abs(value) > 1e8:
        raise InputError(f"{where}: {text[:40]!r} is not a finite number below 1e8")
    return value


def _quantities(where: str, words: list[str]) -> tuple[list[str], list[str]]:
    """Split a command's words into the readings that it names and the other words."""
    count = next((i for i, word in enumerate(words) if word.lower() not in _QUANTITIES), len(words))
    if count == 0:
        raise InputError(f"{where}: {' '.join(words)[:60]!r} names no supported reading")
    return [key for word in words[:count] for key in _QUANTITIES[word.lower()]], words[count:]
