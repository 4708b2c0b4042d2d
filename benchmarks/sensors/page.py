"""Sensors measured: `python -m benchmarks sensors` writes the tables of `docs/evidence/parts/sensors.md`."""

from __future__ import annotations

import argparse
import sys
from itertools import pairwise
from pathlib import Path

from baselines.base.markdown import markdown_table, write_table
from benchmarks.sensors.rates import image_rates, mujoco_rate, own_rates
from benchmarks.sensors.sweeps import (
    INCIDENCE_DEG,
    RANGE_M,
    Bins,
    compare_sweep,
    lost_by_incidence,
    placed_poses,
    spread_by_range,
)
from minexplore.envs.env import MineEnv
from minexplore.world import World, find_world, load_world

PAGE = Path("docs/evidence/parts/sensors.md")
_SCANNER_M = 0.5  # over the flat floor; the drifts' walls are upright there


def sweep_tables(world: World, folder: Path) -> str:
    """Return the tables of returns lost by incidence and of spread by range, real beside simulated."""
    real: list[Bins] = []
    simulated: list[Bins] = []
    for name, pose in placed_poses(world, folder).items():
        one, other = compare_sweep(world, folder / f"sweep_{name}.csv", pose, _SCANNER_M)
        real.append(one)
        simulated.append(other)
    lost = [
        [f"{low} to {high}", f"{bins:,}", f"{100 * share:.2f} %", f"{100 * other:.2f} %"]
        for (low, high), (bins, share), (_, other) in zip(
            pairwise(INCIDENCE_DEG), lost_by_incidence(real), lost_by_incidence(simulated), strict=True
        )
    ]
    spread = [
        [f"{low} to {high}", f"{bins:,}", f"{1000 * real_m:.0f}", f"{1000 * other_m:.0f}"]
        for (low, high), (bins, real_m), (_, other_m) in zip(
            pairwise(RANGE_M), spread_by_range(real), spread_by_range(simulated), strict=True
        )
    ]
    first = markdown_table(("incidence, deg", "bins", "lost, real", "lost, simulated"), lost)
    second = markdown_table(("range, m", "bins", "median spread, real, mm", "simulated, mm"), spread)
    return f"{first}\n{second}"


def main() -> int:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=Path("data/raw"), help="folder of the sweeps and their poses")
    arguments = parser.parse_args()
    world = load_world(find_world("chilean_mine"))
    tables = [markdown_table(("OS1-64, one thread", "rays/s"), [*own_rates(world), mujoco_rate(world)])]
    env = MineEnv("chilean_mine")
    tables.append(markdown_table(("image", "pixels", "frames/s"), image_rates(env)))
    env.close()
    if (arguments.data / "scan_poses.csv").is_file():
        tables.append(sweep_tables(world, arguments.data))
    else:
        print(
            f"sensors: {arguments.data}: no sweeps; `make data` fetches them. Their tables are left out",
            file=sys.stderr,
        )
    text = "\n".join(tables)
    write_table(PAGE, text)
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
