"""The mines of a split in which a policy sees least beside another one, drawn and in a table.

`python -m benchmarks worst-mines --policy graph-cool-42 --beside information-gain` writes the page and its picture.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from baselines.base.environments import make_env
from baselines.base.errors import BaselineError, run_command
from baselines.base.markdown import markdown_table, write_table
from baselines.base.statistics import sample_times
from baselines.scoring.split_file import Drive, read_drives, split_folder
from minexplore.splits import STYLES

matplotlib.use("Agg")
import matplotlib.pyplot as plt

_PAGE, _PICTURE = Path("docs/evidence/parts/worst-mines.md"), Path("docs/worst-mines.jpg")
_MINES = 10
_ROCK, _BLUE, _RED = "#d9d4cc", "#1f5a94", "#b04a2f"
_STANDS_MPS = 0.1


@dataclass(frozen=True)
class EpisodePair:
    """The episodes of two policies in one mine."""

    number: int
    ours: Drive
    theirs: Drive

    @property
    def gain(self) -> float:
        """Return the share of the mine that ours saw more, at the end."""
        return float(share(self.ours) - share(self.theirs))


def share(drive: Drive) -> float:
    """Return the share of a mine's cells that an episode saw."""
    head, episode = drive
    return episode.seen[-1] / head.cells


def stands(drive: Drive) -> float:
    """Return the share of an episode in which the robot moved at less than 0.1 m/s."""
    head, episode = drive
    times = sample_times(episode, float(head.task["control_s"]))  # type: ignore[arg-type]
    moved = np.linalg.norm(np.diff(np.array(episode.path_cm) / 100, axis=0), axis=1)
    spans = np.diff(times)
    return float(spans[moved < _STANDS_MPS * spans].sum() / spans.sum())


def pairs_of(policy: str, other: str, split: str) -> list[EpisodePair]:
    """Return both policies' episodes, mine by mine, the mine with the least gain first.

    Raises
    ------
    BaselineError
        If a policy has no results, or they are of other mines.
    """
    ours, theirs = (read_drives(split_folder(split) / f"{name}.jsonl") for name in (policy, other))
    if [(h.env, h.world_sha256) for h, _ in ours] != [(h.env, h.world_sha256) for h, _ in theirs]:
        raise BaselineError(f"{policy}, {other}: their results on the split {split} are of other mines")
    pairs = [EpisodePair(number, *both) for number, both in enumerate(zip(ours, theirs, strict=True))]
    return sorted(pairs, key=lambda pair: pair.gain)


def draw(pairs: list[EpisodePair], path: Path) -> None:
    """Draw both ways in each mine."""
    figure, axes = plt.subplots(2, -(-len(pairs) // 2), figsize=(3.2 * -(-len(pairs) // 2), 7), layout="constrained")
    for axis in axes.flat:
        axis.set_axis_off()
    for axis, pair in zip(axes.flat, pairs, strict=False):
        _draw_mine(axis, pair)
    figure.savefig(path, dpi=90, pil_kwargs={"quality": 88})
    plt.close(figure)


def _draw_mine(axis: Any, pair: EpisodePair) -> None:
    head, _ = pair.ours
    env = make_env(head.env, 1)
    try:
        world = env.world
    finally:
        env.close()
    rows, cols = world.clearance_m.shape
    west, south = world.origin_m
    frame = (west, west + cols * world.cell_m, south, south + rows * world.cell_m)
    colours = matplotlib.colors.ListedColormap([_ROCK, "white"])
    axis.imshow(world.clearance_m > 0, origin="lower", extent=frame, cmap=colours)
    for (_, episode), colour in ((pair.theirs, _RED), (pair.ours, _BLUE)):
        way = np.array(episode.path_cm) / 100
        axis.plot(*way.T, color=colour, lw=1.2, alpha=0.8)
        axis.plot(*way[0], "o", color="#222222", ms=4)
    axis.set_title(f"{pair.number}: {100 * share(pair.ours):.0f} %, {100 * share(pair.theirs):.0f} %", fontsize=9)


def tables(policy: str, other: str, split: str, pairs: list[EpisodePair], count: int) -> str:
    """Return the table, with whom it compares."""
    rows = []
    for pair in pairs[:count]:
        (head, ours), (_, theirs) = pair.ours, pair.theirs
        style = STYLES[pair.number % len(STYLES)].replace("_", " ")
        figures = (100 * share(pair.ours), 100 * share(pair.theirs), ours.path_m, theirs.path_m)
        idle = (100 * ours.idle / ours.steps, 100 * theirs.idle / theirs.steps, 100 * stands(pair.ours))
        rows.append((pair.number, style, f"{head.cells:,}", *(f"{value:.0f}" for value in (*figures, *idle))))
    gains = np.array([pair.gain for pair in pairs])
    columns = ("mine", "style", "cells", "seen, %", f"{other}, %", "driven, m", f"{other}, m", "idle, %", f"{other}, %")
    return (
        f"The {count} mines of the split {split} in which {policy} (blue) sees least beside {other} (red). "
        f"The dot is the start.\n\n{markdown_table((*columns, 'stands, %'), rows)}\n"
        f"In all {len(pairs)} mines, {policy} sees more in {(gains > 0).sum()}, as much in {(gains == 0).sum()} and "
        f"less in {(gains < 0).sum()}."
    )


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.worst_mines", description=__doc__)
    parser.add_argument("--policy", required=True, help="whose results are looked at")
    parser.add_argument("--beside", required=True, help="whose results they are compared with")
    parser.add_argument("--split", default="test", choices=("validation", "test"))
    arguments = parser.parse_args()
    pairs = pairs_of(arguments.policy, arguments.beside, arguments.split)
    count = min(_MINES, len(pairs))
    draw(pairs[:count], _PICTURE)
    write_table(_PAGE, tables(arguments.policy, arguments.beside, arguments.split, pairs, count))
    print(f"{_PAGE} and {_PICTURE} are written")


if __name__ == "__main__":
    sys.exit(run_command("worst-mines", main))
