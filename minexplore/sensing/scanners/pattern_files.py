"""Patterns of LiDARs as data files: those that ship with the package, from data sheets, and a user's own."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

from minexplore.limits import Span
from minexplore.sealed.json_text import read_json
from minexplore.sensing.scanners.pattern import ScanPattern

_FOLDER = Path(__file__).parent / "patterns"
_SUFFIX = ".json"
_MOST_RAYS = 20_000_000  # of a scan; a VZ-400 has 5.6 million
_ANGLE, _TIME, _RATE = Span(-360.0, 360.0), Span(0.0, 1e4), Span(1e-3, 1e8)
_COUNT = Span(1, _MOST_RAYS, whole=True)
_TEXTS = {"kind", "source"}
_SHARED = {"rate_hz", "elevations_deg", "range_m", "range_at_ten_percent_m", "noise_m"}
_OWN = {
    "spinning": {"columns": _COUNT, "azimuths_deg": _ANGLE, "firing_s": _TIME},
    "rosette": {"points_hz": _RATE, "turns_hz": _RATE, "swings_hz": _RATE, "fan_deg": _ANGLE},
    "lines": {"columns": _COUNT, "lines": _COUNT},
}


def pattern_names() -> list[str]:
    """Return the names of the patterns that ship with the package."""
    return sorted(path.stem for path in _FOLDER.glob(f"*{_SUFFIX}"))


def load_pattern(name: str | Path) -> ScanPattern:
    """Return a pattern by its name, or one of a `.json` file with the fields of those that ship.

    Raises
    ------
    ValueError
        If there is none of that name, or a field is missing, unknown or beyond its limit; the message lists the names
        that there are, or names the field.
    FileNotFoundError
        If there is no such file.
    """
    if isinstance(name, str) and name in pattern_names():
        return _shipped(name)
    path = Path(name) if isinstance(name, str | Path) else Path()
    if path.suffix != _SUFFIX:
        raise ValueError(f"LiDAR = {name!r:.100}: valid choices are {', '.join(pattern_names())}, or a {_SUFFIX} file")
    if not path.is_file():
        raise FileNotFoundError(f"LiDAR = {str(name)!r}: no such file")
    return parse_pattern(path.stem, read_json(str(path), path.read_bytes()))


@functools.cache
def _shipped(name: str) -> ScanPattern:
    path = _FOLDER / f"{name}{_SUFFIX}"
    return parse_pattern(name, read_json(str(path), path.read_bytes()))


def parse_pattern(name: str, record: Any) -> ScanPattern:
    """Return a pattern as its file states it.

    Raises
    ------
    ValueError
        If a field is missing or unknown, or beyond its limit, or the kind is.
    """
    kind = record.get("kind") if isinstance(record, dict) else record
    if not isinstance(kind, str) or kind not in _OWN:
        raise ValueError(f"LiDAR {name}: kind = {kind!r:.100}: valid choices are {', '.join(_OWN)}")
    wrong = set(record) ^ (_TEXTS | _SHARED | set(_OWN[kind]))
    if wrong:
        raise ValueError(f"LiDAR {name}: {sorted(wrong)[0]}: missing or unknown in a pattern of kind {kind!r}")
    channels = len(_numbers(name, record, "elevations_deg", _ANGLE, None if kind == "spinning" else 2))
    _numbers(name, record, "range_m", Span(0.0, 1e6), 2)
    for field, span in _OWN[kind].items():
        if field in ("azimuths_deg", "firing_s"):
            _numbers(name, record, field, span, channels)
        elif field == "fan_deg":
            _pairs(name, record, field, span)
        elif not span.accepts(record[field]):
            raise ValueError(f"LiDAR {name}: {field} = {record[field]!r:.100}: want {span}")
    found = ScanPattern(
        name=name,
        kind=kind,
        source=str(record["source"]),
        rate_hz=record["rate_hz"],
        elevations_deg=tuple(record["elevations_deg"]),
        range_m=tuple(record["range_m"]),
        range_at_ten_percent_m=record["range_at_ten_percent_m"],
        noise_m=record["noise_m"],
        about={field: record[field] for field in _OWN[kind]},
    )
    if not 1 <= found.rays <= _MOST_RAYS:
        raise ValueError(f"LiDAR {name}: {found.rays:,} rays a scan: want 1 to {_MOST_RAYS:,}")
    return found


def _numbers(name: str, record: dict[str, Any], field: str, span: Span, count: int | None) -> list[Any]:
    """Return a field that is a list of so many numbers, or of any count but none."""
    value = record[field]
    right = isinstance(value, list) and all(map(span.accepts, value)) and len(value) > 0
    if not right or (count is not None and len(value) != count):
        many = "one or more" if count is None else f"{count}"
        raise ValueError(f"LiDAR {name}: {field} = {value!r:.100}: want a list of {many}, each {span}")
    return value


def _pairs(name: str, record: dict[str, Any], field: str, span: Span) -> None:
    value = record[field]
    if (
        not isinstance(value, list)
        or not value
        or any(not isinstance(pair, list) or len(pair) != 2 or not all(map(span.accepts, pair)) for pair in value)
    ):
        raise ValueError(f"LiDAR {name}: {field} = {value!r:.100}: want a list of pairs, each {span}")
