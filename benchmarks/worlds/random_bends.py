"""Random level surveys whose legs bend sharply: how wide they are built, and whether robots get along them.

Legs are 5 to 100 m long and turn by 20 to 160 deg; walls are 2 m to each side, uneven, or at the stations on the left.
Tables are read and built as `python -m pipeline new` does. Widths are measured here, by sections of the outline.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from baselines.base.markdown import markdown_table
from pipeline.survey.passages.survey_leg import SurveyLeg
from pipeline.survey.passages.workings import build_workings
from pipeline.survey.solved.station_table import read_stations

KINDS = ("2 m to each wall", "0.5 to 3 m to each wall", "stations on the left wall, 1 to 4 m to the right one")
KEPT = 0.95
_LEGS, _LENGTH_M, _TURN_DEG = (3, 8), (5.0, 100.0), (20.0, 160.0)
_STEP_M, _END = 0.25, 1e-3  # between sections, and from a leg's ends, of its length
_ROBOT_M = 0.35
_SPECK_M2 = 0.01


def traverse(kind: str, rng: np.random.Generator) -> SurveyLeg:
    """Return the stations of one survey, which does not cross itself."""
    while True:
        count = int(rng.integers(_LEGS[0], _LEGS[1] + 1))
        turns = rng.choice([-1, 1], count - 1) * np.radians(rng.uniform(*_TURN_DEG, count - 1))
        heading = np.cumsum([rng.uniform(0, 2 * np.pi), *turns])
        steps = rng.uniform(*_LENGTH_M, count)[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
        places = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        if shapely.LineString(places).is_simple:
            break
    walls = {
        KINDS[0]: lambda: np.full((count + 1, 2), 2.0),
        KINDS[1]: lambda: rng.uniform(0.5, 3.0, (count + 1, 2)),
        KINDS[2]: lambda: np.column_stack([np.zeros(count + 1), rng.uniform(1.0, 4.0, count + 1)]),
    }[kind]()
    return SurveyLeg("1", [f"s{number}" for number in range(count + 1)], places, walls)


def table_of(leg: SurveyLeg) -> str:
    """Return a survey as a table of stations."""
    rows = zip(leg.stations, leg.positions_m.tolist(), leg.walls_m.tolist(), strict=True)
    lines = [f"{leg.name},{name},{x:.4f},{y:.4f},{left:.4f},{right:.4f}" for name, (x, y), (left, right) in rows]
    return "\n".join(["leg,station,easting_m,northing_m,left_m,right_m", *lines]) + "\n"


def least_share(leg: SurveyLeg, free: BaseGeometry) -> float:
    """Return the least share of the survey's section, every 0.25 m along its legs, that is free in one stretch."""
    least = 1.0
    for k, (start, end) in enumerate(pairwise(leg.positions_m)):
        step = end - start
        length = float(np.hypot(*step))
        left = np.array([-step[1], step[0]]) / length
        share = np.linspace(_END, 1 - _END, max(3, int(length / _STEP_M)))[:, None]
        middle, walls = start + share * step, (1 - share) * leg.walls_m[k] + share * leg.walls_m[k + 1]
        sections = np.stack([middle + left * walls[:, :1], middle - left * walls[:, 1:]], axis=1)
        found = shapely.intersection(shapely.linestrings(sections), free)
        parts, of = shapely.get_parts(found, return_index=True)
        widest = np.zeros(len(share))
        np.maximum.at(widest, of, shapely.length(parts))
        least = min(least, float((widest / walls.sum(axis=1)).min()))
    return least


def robots_parts(free: BaseGeometry) -> int:
    """Return how many parts of the workings a robot's middle can be in."""
    return sum(part.area > _SPECK_M2 for part in shapely.get_parts(free.buffer(-_ROBOT_M)))


def judge(kind: str, seed: int) -> tuple[float, int]:
    """Return the least share of a random survey's width, and how many parts robots have."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "survey.csv"
        path.write_text(table_of(traverse(kind, np.random.default_rng(seed))))
        legs = read_stations(path)
    free = build_workings(legs)
    return least_share(legs[0], free), robots_parts(free)


def main() -> int:
    """Measure all surveys and print the table; the exit code is 1 if one is narrower or in parts."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks random-bends", description=__doc__)
    parser.add_argument("--count", type=int, default=500, help="surveys of each kind")
    count, rows, is_good = parser.parse_args().count, [], True
    for kind in KINDS:
        found = [judge(kind, seed) for seed in range(count)]
        shares, parts = zip(*found, strict=True)
        narrow, parted = sum(share < KEPT for share in shares), sum(part != 1 for part in parts)
        rows.append((kind, count, f"{min(shares):.3f}", narrow, parted))
        is_good &= not narrow and not parted
    heads = ("walls", "surveys", "least width, of the survey's", f"under {KEPT:g}", "in parts for a robot of 0.70 m")
    print(markdown_table(heads, rows))
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
