"""Sample and hostile files of levels over each other."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

from benchmarks.fuzzing.builders import Named, absurd_numbers

Files = dict[str, bytes]
Wall = Sequence[Sequence[float]]

_RAMP = [(60, 0, 9), (95, 0, 5), (95, 20, 4), (60, 20, 0), (60, 15, 0), (90, 15, 4), (90, 5, 5), (60, 5, 9), (60, 0, 9)]
_LOWER = [(0, 0, 0), (60, 0, 0), (60, 20, 0), (55, 20, 0), (55, 5, 0), (0, 5, 0), (0, 0, 0)]


def levels() -> Files:
    """Return two levels, a ramp between them, and a shaft."""
    upper = [(0, 0, 9), (60, 0, 9), (60, 5, 9), (0, 5, 9), (0, 0, 9)]
    layers = {"upper": upper, "lower": _LOWER, "ramp": _RAMP, "shafts": [(20, 2.5, 9), (20, 2.5, 0)]}
    features = [
        {"type": "Feature", "properties": {"layer": name}, "geometry": {"type": "LineString", "coordinates": line}}
        for name, line in layers.items()
    ]
    content = {"type": "FeatureCollection", "features": features, "note": "metres"}
    return {"mine.geojson": json.dumps(content).encode()}


def _walls(*lines: Wall) -> Files:
    geometry = {"type": "MultiLineString", "coordinates": lines}
    feature = {"type": "Feature", "properties": {}, "geometry": geometry}
    content = {"type": "FeatureCollection", "features": [feature], "note": "metres"}
    return {"mine.geojson": json.dumps(content).encode()}


def _square(x: float, y: float, z: float, size: float = 5.0) -> Wall:
    return [[x, y, z], [x + size, y, z], [x + size, y + size, z], [x, y + size, z], [x, y, z]]


def _stacked(number: str) -> bytes:
    walls = _walls(_square(0, 0, 0), _square(0, 0, 12), [[2, 2, 12], [2, 2, 77]])["mine.geojson"]
    return walls.replace(b"77", number.encode())


LEVELS: Named = {
    "5,000 levels over each other": lambda: _walls(*(_square(0, 0, 2 * k) for k in range(4999))),
    "5,000 levels that overlap by half": lambda: _walls(
        *(_square(2.5 * (k % 70), 2.5 * (k // 70), 2 * k) for k in range(4999))
    ),
    "20,000 open walls in one place": lambda: _walls(
        _square(0, 0, 0), _square(0, 0, 50), *([[k % 7, k % 11, 9], [k % 13, k % 5, 9 + k % 3]] for k in range(20_000))
    ),
    "helix": lambda: _walls(
        _square(0, 0, 0), _square(0, 0, 50), [[20 * math.cos(k / 9), 20 * math.sin(k / 9), k / 9] for k in range(9000)]
    ),
    "levels 20 km apart": lambda: _walls(_square(0, 0, -9999), _square(0, 0, 9999), [[2, 2, -9999], [2, 2, 9999]]),
    "rings without area": lambda: _walls(
        *([[0, 0, 2 * k], [9, 0, 2 * k], [0, 0, 2 * k], [0, 0, 2 * k]] for k in range(99))
    ),
    "10,000 shafts in one place": lambda: _walls(
        _square(0, 0, 0), _square(0, 0, 12), *([[2, 2, 12], [2, 2, 0]] for _ in range(9999))
    ),
    "10,000 raises in one place": lambda: _walls(
        _square(0, 0, 0), _square(0, 0, 12), *([[2, 2, 60], [2, 2, 12]] for _ in range(9999))
    ),
    "rings that touch at corners": lambda: _walls(*(_square(5 * k, 5 * k, 12 * (k % 2)) for k in range(99))),
    **absurd_numbers("mine.geojson", _stacked),
}
