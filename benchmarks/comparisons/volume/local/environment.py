"""Control steps a second of robots in a volume's local models, beside the level mine's environment in the same run.

`python -m benchmarks.comparisons.volume.local.environment` prints the table; surveys are built as in the gate. At equal
contact is the environment's speed if as many steps touched rock as in the level mine. Each run drives the same ways, so
the least of the runs' times counts: what else the machine does only adds to it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np
from tqdm import tqdm

from baselines.base.markdown import markdown_table
from benchmarks.comparisons.volume.cases import CASES, LEVEL, within
from benchmarks.comparisons.volume.local.drives import LevelDrive, StepCost, VolumeDrive, hard_driving
from benchmarks.comparisons.volume.local.in_memory import VolumeStepping
from pipeline.volume.floors import solve_floors
from pipeline.volume.rock.inside import Inside
from pipeline.volume.shell import ShellPart, build_shell
from pipeline.volume.union import Volume
from pipeline.volume.world.parts import without_refused

_RUNS = 15
_ALL_PARTS = -1.0  # a tolerance that no plane meets
_LARGE_M = (2.0, 0.5)
Variants = dict[str, tuple[float, tuple[float, float]]]  # how far a plane may be from a floor, and tiles, m
BUILT = "planes within 5 mm"  # as the environment has them
VARIANTS: Variants = {
    "all parts in reach of a tile of 2 m": (_ALL_PARTS, _LARGE_M),
    "planes within 3 mm": (0.003, (0.5, 0.25)),
    BUILT: (0.005, (0.5, 0.25)),
}


def build(name: str) -> tuple[Volume, list[ShellPart]]:
    """Return a case's volume, or that about its middle, and its parts."""
    case = CASES[name]
    with tempfile.TemporaryDirectory() as folder:
        network = case.network(Path(folder))
    if case.physics_within_m is not None:
        network = within(network, case.physics_within_m)
    volume = solve_floors(network)
    return volume, without_refused(build_shell(volume))[0]


def measure(
    volume: Volume, parts: list[ShellPart], level: LevelDrive, variants: Variants = VARIANTS
) -> dict[str, tuple[StepCost, StepCost, int]]:
    """Return each variant's cost, the level mine's, the least of runs in turns each, and how many robots are gone."""
    actions, drives = hard_driving(np.random.default_rng(0)), {}
    for title, (tolerance_m, tile_m) in variants.items():
        local = VolumeStepping(volume, parts, None, tolerance_m, tile_m)
        drives[title] = VolumeDrive(volume, local, np.random.default_rng(1))
        drives[title].cost(actions)  # makes models and planes, as the level mine's next line does
    level.cost(actions)
    runs = [(level.cost(actions), [drive.cost(actions) for drive in drives.values()]) for _ in range(_RUNS)]
    inside, theirs = Inside(volume), _least([run[0] for run in runs])
    return {
        title: (
            _least([run[1][k] for run in runs]),
            theirs,
            int((inside.distance_m(drive.stepper.qpos[:, :3]) < 0).sum()),
        )
        for k, (title, drive) in enumerate(drives.items())
    }


def _least(costs: list[StepCost]) -> StepCost:
    contact = median(cost.contact_us for cost in costs)  # a difference of two times
    return replace(min(costs, key=lambda cost: cost.total_us), contact_us=contact)


def rows_of(name: str, found: dict[str, tuple[StepCost, StepCost, int]]) -> list[tuple[str, ...]]:
    """Return the table's rows of a case."""
    return [
        (
            name,
            title,
            f"{ours.choice_us:.0f} + {ours.physics_us:.0f}",
            f"{theirs.physics_us:.0f} + {theirs.rest_us:.0f}",
            f"{theirs.physics_us / (ours.choice_us + ours.physics_us):.2f}",
            f"{theirs.total_us / (ours.total_us + theirs.rest_us):.2f}",
            f"{theirs.total_us / (ours.total_us + theirs.rest_us - _more_contact_us(ours, theirs)):.2f}",
            f"{100 * ours.parts_share:.0f} %",
            f"{100 * ours.touch_share:.0f} / {100 * theirs.touch_share:.0f} %",
            str(gone),
        )
        for title, (ours, theirs, gone) in found.items()
    ]


def _more_contact_us(ours: StepCost, theirs: StepCost) -> float:
    """Return what of a step's cost is that robots touch rock in more steps than in the level mine."""
    return (ours.touch_share - theirs.touch_share) * ours.contact_us


HEADER = (
    "survey",
    "local models",
    "choice + physics, us",
    "level: physics + rest, us",
    "physics",
    "environment",
    "at equal contact",
    "on parts",
    "touch rock",
    "escaped",
)


def main() -> int:
    """Measure the cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", help=f"default: {' '.join(CASES)}")
    parser.add_argument("--level", type=Path, default=LEVEL, help="the level world that is compared with")
    a = parser.parse_args()
    unknown = sorted(set(a.cases) - set(CASES))
    if unknown:
        parser.error(f"no case {unknown[0]!r}; there are {', '.join(CASES)}")
    level = LevelDrive(a.level)
    rows: list[tuple[str, ...]] = []
    for name in tqdm(a.cases or CASES, unit="case", disable=None):
        rows += rows_of(CASES[name].title, measure(*build(name), level))
        print(markdown_table(HEADER, rows[-len(VARIANTS) :]), end="", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
