"""Robots and balls thrown all over a volume, region by region: how many get behind its walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume
from pipeline.volume.world.proof.region import regions_over
from pipeline.volume.world.proof.throws import Throws, throw_balls, throw_robots

PARTS = 3000  # of a region: MuJoCo's specs take 1 ms a part, and its steps go by parts


@dataclass(frozen=True)
class Mine:
    """A volume and its collision parts, about the volume's middle."""

    volume: Volume
    parts: list[ShellPart]


def throw_everywhere(mine: Mine, robots: int, balls: int, most: int = PARTS) -> tuple[Throws, Throws]:
    """Return what became of robots and of balls that are thrown in all regions of a mine.

    Parameters
    ----------
    mine : Mine
    robots, balls : int
        Least contacts, in all regions together. Balls go on until each facet had one.
    most : int
        Parts of a region.
    """
    regions = list(regions_over(mine.volume, mine.parts, most))
    asked = [-(-contacts // len(regions)) for contacts in (robots, balls)]
    thrown, pushed = Throws(), Throws()
    for number, region in enumerate(regions):
        rng = np.random.default_rng([0, number])
        thrown += throw_robots(mine.volume, region.parts, asked[0], rng, targets=region.targets)
        pushed += throw_balls(mine.volume, region.parts, asked[1], True, rng, targets=region.targets)
    return thrown, pushed
