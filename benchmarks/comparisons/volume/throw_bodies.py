"""Robots and balls thrown all over a volume: how many are behind its walls. A run goes on where the last one stopped.

`python -m benchmarks volume-throws CASE` throws robots from its floors and pushes a ball at every facet. A case is one
of the gate, or the folder of a world that is one volume. The mine is parted into regions of some parts.
"""

from __future__ import annotations

import argparse
import dataclasses
import re
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from baselines.base.markdown import markdown_table
from benchmarks.comparisons.volume.cases import CASES
from benchmarks.resume import Row, resume, run_benchmark
from pipeline.errors import InputError
from pipeline.volume.floors import solve_floors
from pipeline.volume.shell import ShellPart, build_shell
from pipeline.volume.union import Volume
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.parts import without_refused
from pipeline.volume.world.proof.certificate import open_volume
from pipeline.volume.world.proof.fronts import fronts_of
from pipeline.volume.world.proof.region import regions_over
from pipeline.volume.world.proof.throws import Throws, throw_balls, throw_robots

FOLDER, KEPT = Path("artifacts/bench/volume-throws"), "regions.jsonl"
PARTS = 3000  # of a region: MuJoCo's specs take 1 ms a part, and its steps go by parts


@dataclass(frozen=True)
class Mine:
    """A volume and its collision parts, about the volume's middle."""

    volume: Volume
    parts: list[ShellPart]


def mine_of(case: str, folder: Path) -> Mine:
    """Build a case of the gate, or read the folder of a world.

    Raises
    ------
    InputError
        If it is neither.
    """
    if case in CASES:
        network = CASES[case].network(folder)
        volume = solve_floors(network)
        return Mine(volume, without_refused(build_shell(volume))[0])
    if not Path(case).is_dir():
        raise InputError(f"no case {case!r} and no folder of a world; the cases are {', '.join(CASES)}")
    world = open_volume(Path(case))
    volume = closed_volume(world.mine)
    return Mine(volume, fronts_of(volume, world.parts).parts)


def throw_everywhere(mine: Mine, kept: Path, robots: int, balls: int, most: int = PARTS, seed: int = 0) -> list[Row]:
    """Return a row for each region of a mine, with those that a file holds already; the others are added to it.

    Parameters
    ----------
    mine : Mine
    kept : Path
        Of JSON lines.
    robots, balls : int
        Least contacts, in all regions together. Balls go on until each facet had one.
    most : int
        Parts of a region.
    seed : int
    """
    regions = list(regions_over(mine.volume, mine.parts, most))
    asked = [-(-contacts // len(regions)) for contacts in (robots, balls)]

    def measure(missing: list[str]) -> Iterable[Row]:
        for key in missing:
            number = int(key.split("/")[0])
            region, rng = regions[number], np.random.default_rng([seed, number])
            start = time.process_time()
            thrown = throw_robots(mine.volume, region.parts, asked[0], rng, targets=region.targets)
            pushed = throw_balls(mine.volume, region.parts, asked[1], True, rng, targets=region.targets)
            row = {"key": key, "parts": len(region.parts), "facets": int(region.targets.sum())}
            row |= {"robots": dataclasses.asdict(thrown), "balls": dataclasses.asdict(pushed)}
            yield row | {"seconds": time.process_time() - start}

    keys = [f"{k}/{len(regions)} {asked[0]} {asked[1]} {seed}" for k in range(len(regions))]
    rows = resume(kept, keys, measure, "region", key=lambda row: row["key"])
    return [row for row in rows if row["key"] in keys]


def thrown_in(mine: Mine, kept: Path, robots: int, balls: int) -> dict[str, int]:
    """Return the contacts of robots and balls thrown all over a mine, and how many escaped."""
    rows = throw_everywhere(mine, kept, robots, balls)
    found = [Throws(**row[kind]) for row in rows for kind in ("robots", "balls")]
    return {"contacts": sum(one.contacts for one in found), "escapes": sum(one.escapes for one in found)}


def table_of(rows: list[Row]) -> str:
    """Return what was thrown in all regions as a table."""
    lines = []
    for kind in ("robots", "balls"):
        found = sum((Throws(**row[kind]) for row in rows), Throws())
        lines.append((kind, f"{found.throws:,}", f"{found.facets:,}", f"{found.contacts:,}", f"{found.escapes}"))
    return markdown_table(("", "throws", "facets", "contacts", "escapes"), lines)


def main() -> int:
    """Throw what is missing; print the table. The exit code is 1 if something escaped."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks volume-throws", description=__doc__)
    parser.add_argument("case", help=f"{', '.join(CASES)}, or the folder of a world")
    parser.add_argument("--contacts", type=float, default=1e6, help="least contacts of robots")
    parser.add_argument("--ball-contacts", type=float, default=1e5, help="least contacts of balls")
    a = parser.parse_args()
    name = re.sub(r"\W+", "-", a.case).strip("-")
    folder = FOLDER / name
    folder.mkdir(parents=True, exist_ok=True)
    mine = mine_of(a.case, folder)
    rows = throw_everywhere(mine, folder / KEPT, int(a.contacts), int(a.ball_contacts))
    print(f"{a.case}: {len(mine.volume.faces):,} facets, {len(mine.parts):,} parts, {len(rows)} regions, ", end="")
    print(f"{sum(row['seconds'] for row in rows):.0f} s of processor time\n\n{table_of(rows)}")
    return int(any(row[kind]["escapes"] for row in rows for kind in ("robots", "balls")))


if __name__ == "__main__":
    sys.exit(run_benchmark("volume-throws", main))
