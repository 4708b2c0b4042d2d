"""What explorers lose in dust and water: `python -m benchmarks conditions-loss`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from baselines.base.markdown import markdown_table, write_table
from baselines.explorers import EXPLORERS
from benchmarks.sensors.odometry_loss import ENV, Drives, explore
from minexplore.sensing.params import preset_names

PAGE = Path("docs/evidence/parts/conditions-loss.md")


def row_of(policy: str, env_id: str, seeds: list[int]) -> list[str]:
    """Return one explorer's row: coverage and collisions under each preset."""
    drives: list[Drives] = [explore(policy, env_id, seeds, conditions=preset) for preset in preset_names()]
    coverage = [f"{100 * each.coverage:.1f} %" for each in drives]
    return [policy, *coverage, *(f"{each.collisions:.1f}" for each in drives)]


def main() -> int:
    """Run the explorers and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--policy", nargs="*", default=[name for name in EXPLORERS if name != "random"])
    parser.add_argument("--env", default=ENV)
    parser.add_argument("--episodes", type=int, default=2)
    arguments = parser.parse_args()
    columns = ["explorer", *(f"coverage, {name}" for name in preset_names())]
    columns += [f"collisions, {name}" for name in preset_names()]
    rows = []
    for policy in arguments.policy:
        rows.append(row_of(policy, arguments.env, list(range(arguments.episodes))))
        print(*rows[-1], flush=True)
    about = f"Means of {arguments.episodes} episodes each in `{arguments.env}`.\n\n"
    write_table(PAGE, about + markdown_table(columns, rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
