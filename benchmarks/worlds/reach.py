"""What a robot reaches of worlds that are one volume: by the environment, by a flood of contacts, and by driving.

`python -m benchmarks reach` builds Wheal Pell, Sakany, a tee with heights and ten narrow mines, or takes the bundles
that are named.
A flood of 10 cm takes places where MuJoCo finds no contact of the robot's chassis with rock and its castors are over
floor, whichever way it is turned. The environment's robot is driven to every cell, and from the last places on over
floors that it should not reach.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from baselines.base.markdown import markdown_table, write_table
from benchmarks.worlds.chassis_flood import flood
from benchmarks.worlds.reach_drives import ReachDrives
from minexplore.physics.robot import RobotParams
from minexplore.world import World, load_world
from tests.heights import HEADER
from tests.volumes import TEE, build_volume

PAGE = Path("artifacts/bench/reach.md")
_PELL, _SAKANY = Path("data/wheal_pell/pell.3d"), Path("data/sakany/Sakany_nodes.dat")
_SAKANY_HALF_M = 1.0  # of its passages, as `--half-width` states it: nobody measured their walls
_NARROW, _WIDTH_M, _CHAMBER_M = 10, (0.75, 1.2), 3.0


def narrow_mine(seed: int, width_m: float | None = None) -> str:
    """Return the station table of a passage as wide as stated, else 0.75 to 1.2 m, that winds between two chambers."""
    rng = np.random.default_rng(seed)
    wide = rng.uniform(*_WIDTH_M) if width_m is None else width_m
    widths = [_CHAMBER_M] * 2 + [wide] * 8 + [_CHAMBER_M] * 2
    place, heading, rows = np.zeros(3), rng.uniform(0, 2 * np.pi), []
    for k, width in enumerate(widths):
        x, y, z = place.tolist()
        rows.append(f"A,p{k},{x:.3f},{y:.3f},{width / 2:.4f},{width / 2:.4f},{z:.3f},2,0\n")
        heading += rng.uniform(-0.25, 0.25)
        run = 4.0 if k in (0, len(widths) - 2) else rng.uniform(3, 8)
        place = place + run * np.array([np.cos(heading), np.sin(heading), rng.uniform(-0.1, 0.1)])
    return HEADER + "".join(rows)


def judge(name: str, world: World) -> tuple[str, ...]:
    """Return a row of the table: what the environment, the flood and robots reach."""
    drives, robot = ReachDrives(world), RobotParams()
    cells = drives.cells_at(flood(world, robot).from_place(drives.anchor_m))
    flooded, missed = len(np.unique(cells, axis=0)), len(np.unique(cells[cells[:, 0] < 0], axis=0))
    driven = drives.drive()
    return (
        name,
        str(drives.grid.total),
        str(flooded),
        f"{100 * (flooded - missed) / flooded:.1f} %",
        f"{driven.arrived} of {driven.cells}",
        str(driven.ways_on),
        f"{driven.beyond_m:.2f}",
    )


def _worlds(bundles: list[Path], narrow: int, folder: Path) -> Iterator[tuple[str, World]]:
    if not bundles:
        yield "Wheal Pell", load_world(build_volume(_PELL, _new(folder)))
        yield "a tee with heights", load_world(build_volume(TEE, _new(folder)))
        yield "Sakany", load_world(build_volume(_SAKANY, _new(folder), half_width_m=_SAKANY_HALF_M))
    for seed in range(narrow):
        yield f"narrow mine {seed}", load_world(build_volume(narrow_mine(seed), _new(folder)))
    for path in bundles:
        yield str(path), load_world(path)


def _new(folder: Path) -> Path:
    return Path(tempfile.mkdtemp(dir=folder))


def main() -> int:
    """Print the table; write it where no bundle is named."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks reach", description=__doc__)
    parser.add_argument("bundles", type=Path, nargs="*", help="folders of worlds, instead of those it builds")
    parser.add_argument("--narrow", type=int, default=None, help="how many narrow mines: 10, or none beside bundles")
    a = parser.parse_args()
    narrow = a.narrow if a.narrow is not None else 0 if a.bundles else _NARROW
    head = (
        "world",
        "cells",
        "flood of 10 cm",
        "of these reached",
        "robots arrived at",
        "ways on",
        "farthest beyond, m",
    )
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for name, world in _worlds(a.bundles, narrow, Path(folder)):
            rows.append(judge(name, world))
            print(*rows[-1], sep=", ", flush=True)
    text = markdown_table(head, rows)
    print(text)
    if not a.bundles:
        PAGE.parent.mkdir(parents=True, exist_ok=True)
        write_table(PAGE, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
