"""Random mines with heights, built and certified: `make random-levels`. Each row says what was built, or why not."""

from __future__ import annotations

import argparse
import collections
import sys
import tempfile
from pathlib import Path

import numpy as np

from pipeline.compose import compose
from pipeline.errors import MineError
from pipeline.proof.validator import Validator
from tests.heights import Leg, MineWithHeights, certificate_params

_LEGS, _LENGTH_M, _GRADE, _TURN_RAD = (6, 14), (14.0, 30.0), 0.13, 1.2
_WITHIN_M, _STATION_M = 0.01, 0.02


def random_legs(rng: np.random.Generator) -> dict[str, Leg]:
    """Return a decline that wanders, with level drifts from some of its stations."""
    x, y, z, heading = 0.0, 0.0, 200.0, rng.uniform(-np.pi, np.pi)
    way: Leg = [("d0", x, y, z)]
    legs: dict[str, Leg] = {"D": way}
    bias = rng.choice([-0.6, 0.0, 0.6])  # some wind round themselves
    for k in range(1, int(rng.integers(*_LEGS))):
        run, slope = rng.uniform(*_LENGTH_M), -rng.uniform(0.3, 1.0) * _GRADE
        heading += bias + rng.uniform(-_TURN_RAD, _TURN_RAD) * (0.4 if bias else 1.0)
        if k > 1 and rng.random() < 0.3:
            side = heading + rng.choice([-1, 1]) * rng.uniform(1.0, 1.6)
            far = rng.uniform(*_LENGTH_M)
            legs[f"S{k}"] = [(f"d{k - 1}", x, y, z), (f"s{k}", x + far * np.cos(side), y + far * np.sin(side), z)]
        x, y, z = x + run * np.cos(heading), y + run * np.sin(heading), z + slope * run
        way.append((f"d{k}", x, y, z))
    return legs


def main() -> int:
    """Build and certify random mines; return 1 if one that was built does not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="seed of the first mine")
    parser.add_argument("--contacts", type=int, default=200)
    arguments = parser.parse_args()
    config = compose(["preset=light"])
    tally: collections.Counter[str] = collections.Counter()
    for seed in range(arguments.first, arguments.first + arguments.count):
        legs = random_legs(np.random.default_rng(seed))
        with tempfile.TemporaryDirectory() as folder:
            try:
                mine = MineWithHeights(legs, config, Path(folder))
            except MineError as error:
                tally["refused"] += 1
                print(f"{seed}: refused: {str(error).removeprefix(folder)}", flush=True)
                continue
            stated = certificate_params(config, arguments.contacts)
            validator = Validator(stated, mine.bundle, mine.cleaned, mine.raw, mine.survey)
            broken = [name for name, clause in validator.certificate.clauses.items() if not clause.holds]
            stations = mine.stations()
            off = float(np.abs(mine.floor.heights_at(stations[:, :2]) - stations[:, 2]).max())
            wheels = float(validator.containment["floor_error_m"])
            if off > _STATION_M or wheels > _WITHIN_M or mine.network.loops:
                broken.append(f"station {off:.3f} m, floor {wheels:.3f} m, loops {mine.network.loops}")
            tally["holds" if not broken else "fails"] += 1
            sheets = len(mine.floor.offset_m)
            print(f"{seed}: {sheets} sheets, {'holds' if not broken else 'FAILS ' + ', '.join(broken)}", flush=True)
    print(", ".join(f"{number} {what}" for what, number in tally.items()))
    return int(tally["fails"] > 0)


if __name__ == "__main__":
    sys.exit(main())
