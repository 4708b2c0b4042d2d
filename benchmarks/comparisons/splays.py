"""How walls follow splays: of those that make the walls, and of every fifth one, held back in turn.

Each survey is built without visible rock. Then every fifth splay is left out, the survey is built again, and the ends
of those left out are compared with the rock that was built without them; five times, so that each is left out once, and
all of them are judged together. With `--every 50` nearly all others are kept.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path
from typing import Any

import numpy as np

from baselines.base.markdown import markdown_table
from minesurveys.solved.model import LegFlag, SolvedSurvey
from minesurveys.solved_surveys import solve_file
from pipeline.params.compile3d import VolumeParams
from pipeline.survey.whole_survey import built_piece, whole_legs
from pipeline.volume.floors import solve_floors
from pipeline.volume.union import Volume
from pipeline.volume.world.proof.surveyed.walls import splay_ends, splay_figures
from pipeline.volume.world.topology import mine_network

EVERY = 5
_HEIGHT_M = 3.5  # where nobody measured a roof, as compile3d.height_m
_COLUMNS = ("count", "median", "p95", "within_10cm", "within_30cm", "nearer_30cm")
_ENDS_M = 0.01  # coordinates of solved surveys are centimetres


def build(path: Path, survey: SolvedSurvey, half_width_m: float | None) -> tuple[Volume, np.ndarray, np.ndarray]:
    """Return the volume of a survey in its own frame, its stations (n, 3) m, and its splays (k, 2, 3) m."""
    found = built_piece(path, survey, whole_legs(path, survey, half_width_m), None)
    network, offset = mine_network(found, _HEIGHT_M, VolumeParams())
    up = offset + np.array([0, 0, found.datum_m])
    solved = solve_floors(network)
    datum = np.array([0, 0, found.datum_m])
    return dataclasses.replace(solved, vertices=solved.vertices + up), found.positions_m + datum, found.splays_m + datum


def held_back(path: Path, survey: SolvedSurvey, half_width_m: float | None, part: int, every: int) -> np.ndarray:
    """Return the ends of every so many splays from one on, as `splay_ends`, in the volume built without these."""
    splays = np.flatnonzero((survey.leg_flags & LegFlag.SPLAY) > 0)
    out = splays[part::every]
    kept = np.setdiff1d(np.arange(len(survey.legs)), out)
    less = dataclasses.replace(
        survey, legs=survey.legs[kept], leg_flags=survey.leg_flags[kept], leg_styles=survey.leg_styles[kept]
    )
    volume, stations, _ = build(path, less, half_width_m)
    ends = survey.positions_m[survey.legs[out]]
    near = np.array([np.abs(stations - start).max(axis=1).min() < _ENDS_M for start in ends[:, 0]])
    return splay_ends(volume, ends[near])


def main() -> int:
    """Print a table of each survey."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks splays", description=__doc__)
    parser.add_argument("file", nargs="+", type=Path, help="solved surveys, or what `pipeline new` solves")
    parser.add_argument("--half-width", type=float, help="m to a wall that nobody measured")
    parser.add_argument("--every", type=int, default=EVERY, help="of so many splays one is held back at a time")
    arguments = parser.parse_args()
    for path in arguments.file:
        survey = solve_file(path)
        if not (survey.leg_flags & LegFlag.SPLAY).any():
            print(f"{path.name}: no splays", file=sys.stderr)
            continue
        volume, _, splays = build(path, survey, arguments.half_width)
        parts = [held_back(path, survey, arguments.half_width, k, arguments.every) for k in range(arguments.every)]
        judged = {"used": splay_ends(volume, splays), f"held back, 1 of {arguments.every}": np.concatenate(parts)}
        rows = [
            [name, kind, *_row(found)] for name, ends in judged.items() for kind, found in splay_figures(ends).items()
        ]
        print(f"\n{path.name}\n\n" + markdown_table(["splays", "direction", *_COLUMNS], rows))
    return 0


def _row(found: dict[str, Any]) -> list[str]:
    return [f"{found[name]:g}" for name in _COLUMNS]


if __name__ == "__main__":
    sys.exit(main())
