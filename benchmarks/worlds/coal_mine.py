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

EXTENT_M, HALF_M = (5600.0, 7700.0), 2.5  # of the mine; half width of its roadways
_MAINS, _GATES = 5, 2  # parallel roadways of the mains and of a panel
_APART_M, _CROSSCUT_M = 30.0, 60.0  # between neighbouring roadways; between cross cuts
_SHIFT_M = 1.0  # of junctions from the ladder's corners
_LEAST_BARRIER_M = 40.0  # between neighbouring panels

Line = np.ndarray  # (n, 2) m


def coal_mine(length_m: float, extent_m: tuple[float, float] = EXTENT_M, seed: int = 1) -> list[Line]:
    """Return the roadways of a mine of about so many metres in an extent (east, north), as lines, m.

    Mains run north through the middle. Panels of two roadways leave them to the east and to the west, in pairs, spread
    over the extent; their number makes the length. Junctions are up to a metre from the ladders' corners.

    Raises
    ------
    ValueError
        If the mains alone are longer, or so many panels do not fit.
    """
    rng = np.random.default_rng(seed)
    east, north = extent_m
    half = (_MAINS - 1) * _APART_M / 2
    panel_m = east / 2 - half
    lines = [line[:, ::-1] + (-half, 0.0) for line in _ladder(_MAINS, north, rng)]
    pairs = round((length_m - total_m(lines)) / (2 * total_m(_ladder(_GATES, panel_m, rng))))
    apart = north / max(pairs, 1)
    if pairs < 1 or apart < (_GATES - 1) * _APART_M + _LEAST_BARRIER_M:
        raise ValueError(f"{length_m:g} m of roadways do not fit {east:g} x {north:g} m")
    for n in range(pairs):
        corner = (half, (n + 0.5) * apart - _APART_M / 2)
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
    parser.add_argument("--km", type=float, default=218.0, help="length of all roadways")
    parser.add_argument("--extent", type=float, nargs=2, default=EXTENT_M, metavar=("EAST_M", "NORTH_M"))
    parser.add_argument("file", type=Path)
    options = parser.parse_args()
    lines = coal_mine(1000 * options.km, (options.extent[0], options.extent[1]))
    write_atomically(options.file, geojson(lines).encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
