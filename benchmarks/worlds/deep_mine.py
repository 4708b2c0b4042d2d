"""Write the station table of a deep mine: levels under one another, and a decline that joins them.

    python -m benchmarks.worlds.deep_mine --levels 20 --km 80 deep.csv
    python -m pipeline new deep --from deep.csv

Each level has two drifts with crosscuts between them; the decline winds down one turn from level to level.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from pipeline.store.files import write_atomically
from tests.heights import Leg, table

_APART_M, _GRADE = 50.0, 0.14  # from level to level; of the decline
_ACCESS_M, _CROSSCUT_M, _BETWEEN_M = 60.0, 60.0, 40.0  # from the decline to the drifts; their distance; of crosscuts
_STRAIGHT_M, _TURN, HALF_M = 60.0, 8, 2.5  # of the decline: straight part, legs of half a turn; half width
_SHIFT_M, _RISE = 3.0, 0.005  # of stations from their places, and of drifts away from the decline


def deep_mine(levels: int, length_m: float, seed: int) -> dict[str, Leg]:
    """Return the legs of a mine of so many levels and about so many metres of drift."""
    rng = np.random.default_rng(seed)
    of_level = length_m / levels - _APART_M / _GRADE - _ACCESS_M
    bays = max(2, int(of_level / (2 * _BETWEEN_M + _CROSSCUT_M)))
    legs: dict[str, Leg] = {}
    for n in range(levels):
        z = -n * _APART_M
        access = [(f"L{n}", 0.0, 0.0, z), *((f"a{n}-{i}", _ACCESS_M * i / 3, 0.0, z) for i in (1, 2, 3))]
        drifts: list[Leg] = []
        for name, north in (("m", 0.0), ("p", _CROSSCUT_M)):
            shift = rng.uniform(-_SHIFT_M, _SHIFT_M, (bays + 1, 2))
            shift[0] *= name == "p"  # the first drift begins at the access
            east = _ACCESS_M + _BETWEEN_M * np.arange(bays + 1)
            rise = z + _RISE * _BETWEEN_M * np.arange(bays + 1)
            places = np.column_stack([east + shift[:, 0], north + shift[:, 1], rise])
            drifts.append([(f"{name}{n}-{i}", x, y, h) for i, (x, y, h) in enumerate(places.tolist())])
        drifts[0][0] = access[-1]
        legs |= {f"A{n}": access, f"M{n}": drifts[0], f"P{n}": drifts[1]}
        legs |= {f"C{n}-{i}": [one, two] for i, (one, two) in enumerate(zip(*drifts, strict=True))}
        if n + 1 < levels:
            legs[f"D{n}"] = [access[0], *_turn(n, z), (f"L{n + 1}", 0.0, 0.0, z - _APART_M)]
    return legs


def _turn(number: int, z: float) -> Leg:
    """Return the stations of one turn of the decline: north, round, south, and round to where it began."""
    run = _APART_M / _GRADE
    radius = (run - 2 * _STRAIGHT_M) / (2 * np.pi)
    share = np.arange(1, 4) / 3 * _STRAIGHT_M
    angle = np.arange(1, _TURN + 1) / _TURN * np.pi
    round_m = radius * angle
    pieces = [
        np.column_stack([0 * share, share, share]),
        np.column_stack([radius * (np.cos(angle) - 1), _STRAIGHT_M + radius * np.sin(angle), _STRAIGHT_M + round_m]),
        np.column_stack([0 * share - 2 * radius, _STRAIGHT_M - share, _STRAIGHT_M + np.pi * radius + share]),
        np.column_stack(
            [-radius * (1 + np.cos(angle)), -radius * np.sin(angle), 2 * _STRAIGHT_M + np.pi * radius + round_m]
        ),
    ]
    places = np.concatenate(pieces)[:-1]  # the last is the next level's
    return [(f"d{number}-{i}", float(x), float(y), float(z - _GRADE * s)) for i, (x, y, s) in enumerate(places)]


def main() -> int:
    """Write the station table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds.deep_mine", description=__doc__)
    parser.add_argument("--levels", type=int, default=20)
    parser.add_argument("--km", type=float, default=80.0, help="length of all drifts")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("file", type=Path)
    options = parser.parse_args()
    legs = deep_mine(options.levels, 1000 * options.km, options.seed)
    write_atomically(options.file, table(legs, HALF_M).encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
