"""How rules explore in the simulator: episodes of one robot after the other's yaw in given mines."""

from __future__ import annotations

import numpy as np

from baselines.explorers.graph_explorer import Situation
from baselines.graph.choosing import Rule
from baselines.graph.training.simulator import MapSimulator


def drive(sim: MapSimulator, rule: Rule, seed: int) -> np.ndarray:
    """Return the share of the mine that each robot of a simulator has seen at the end of its episode (n,)."""
    rng, robots = np.random.default_rng(seed), np.arange(sim.count)
    sim.reset(robots, rng.uniform(-np.pi, np.pi, sim.count), rng)

    def choose(asked: np.ndarray, situations: list[Situation]) -> list[int]:
        return [rule(each, sim.context(i)) for i, each in zip(asked.tolist(), situations, strict=True)]

    sim.run(choose, robots, np.full(sim.count, sim.horizon_s), rng)
    return sim.cells_seen / sim.senses.grid.total
