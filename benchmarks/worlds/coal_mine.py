"""Write the centrelines of a level coal mine: mains, and panels of parallel roadways on both sides of them.

    python -m benchmarks.worlds.coal_mine --km 218 coal.geojson
    python -m pipeline new coal --from coal.geojson --unit m --half-width 2.5 preset=light

Cross cuts join neighbouring roadways of the mains and of each panel, as rungs join a ladder's rails.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np

from pipeline.store.files import write_atomically

_KM = 218.0  # of roadways
_EXTENT_M = (5600.0, 7700.0)  # of a mine so long: to the east, to the north
HALF_M = 2.5  # of its roadways
_MAINS, _GATES = 5, 2  # parallel roadways of the mains and of a panel
_APART_M, _CROSSCUT_M = 30.0, 60.0  # between neighbouring roadways; between cross cuts
_SHIFT_M = 1.0  # of junctions from the ladder's corners

Line = np.ndarray  # (n, 2) m


def extent_of(length_m: float) -> tuple[float, float]:
    """Return how far a mine extends to the east and to the north, m: its area grows with its length."""
    share = (length_m / 1000 / _KM) ** 0.5
    return share * _EXTENT_M[0], share * _EXTENT_M[1]


def coal_mine(length_m: float, seed: int = 1) -> list[Line]:
    """Return the roadways of a mine of about so many metres, as lines, m.

    Mains run north through the middle. Panels of two roadways leave them to the east and to the west, in pairs, spread
    over the extent; their number makes the length. Junctions are up to a metre from the ladders' corners.

    Raises
    ------
    ValueError
        If the mains alone are longer.
    """
    rng = np.random.default_rng(seed)
    east, north = extent_of(length_m)
    half = (_MAINS - 1) * _APART_M / 2
    panel_m = east / 2 - half
    lines = [line[:, ::-1] + (-half, 0.0) for line in _ladder(_MAINS, north, rng)]
    pairs = round((length_m - total_m(lines)) / (2 * total_m(_ladder(_GATES, panel_m, rng))))
    if pairs < 1:
        raise ValueError(f"{length_m:g} m of roadways: the mains alone have {total_m(lines):.0f} m")
    for n in range(pairs):
        corner = (half, (n + 0.5) * north / pairs - _APART_M / 2)
        for side in (1, -1):
            lines += [(line + corner) * (side, 1) for line in _ladder(_GATES, panel_m, rng)]
    return lines


def _ladder(count: int, length_m: float, rng: np.random.Generator) -> list[Line]:
    """Return parallel roadways to the east from the origin, and the cross cuts between neighbours."""
    along = np.append(np.arange(0, length_m, _CROSSCUT_M), length_m)
    places = np.stack(np.meshgrid(along, _APART_M * np.arange(count)), axis=2)  # (count, n, 2)
    places[:, 1:-1] += rng.uniform(-_SHIFT_M, _SHIFT_M, places[:, 1:-1].shape)
    cuts = np.stack([places[:-1, 1:], places[1:, 1:]], axis=2).reshape(-1, 2, 2)
    return [*places, *cuts]


def total_m(lines: list[Line]) -> float:
    """Return the length of all lines, m."""
    return sum(float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()) for line in lines)


def geojson(lines: list[Line]) -> str:
    """Return lines as GeoJSON."""
    shapes = [{"type": "LineString", "coordinates": line.round(3).tolist()} for line in lines]
    features = [{"type": "Feature", "properties": {}, "geometry": shape} for shape in shapes]
    return json.dumps({"type": "FeatureCollection", "features": features})


def main() -> int:
    """Write the centrelines."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds.coal_mine", description=__doc__)
    parser.add_argument("--km", type=float, default=_KM, help="length of all roadways")
    parser.add_argument("file", type=Path)
    options = parser.parse_args()
    write_atomically(options.file, geojson(coal_mine(1000 * options.km)).encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
