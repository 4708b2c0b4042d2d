"""Episodes that training learns from: robots explore a mine by draws, and each decision is credited afterwards."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from baselines.explorers.graph_explorer import Situation
from baselines.graph.choosing import keeps_goal
from baselines.graph.features import Scene, describe
from baselines.graph.network import Shape, scores, told
from baselines.graph.scenes import Scenes, join_scenes, stack_scenes
from baselines.graph.training.fresh_ground import fresh_ground
from baselines.graph.training.simulator import MapSimulator

_EVERY_S = 5.0  # at which the cells that a robot has seen are noted
_LEAST_CELLS = 5.0  # that a credit is divided by, where robots see almost nothing


@dataclass(frozen=True)
class Network:
    """What scores clusters: a network, or without arrays the rule that training begins with."""

    arrays: dict[str, np.ndarray] | None
    shape: Shape
    temperature_m: float = 4.0  # of the softmax that the rule's choices are drawn from

    def scores(self, scene: Scene) -> np.ndarray:
        """Return the logits (k,) of a scene's clusters."""
        if self.arrays is None:
            return fresh_ground(told(self.shape, scene.tokens)) / self.temperature_m
        return scores(self.arrays, self.shape, scene.tokens, scene.apart_m)


@dataclass(frozen=True)
class Decisions:
    """The decisions of all robots in one mine.

    Attributes
    ----------
    scenes : Scenes
    chosen : (n,) int
        Index of the cluster in its scene.
    log_chance : (n,) float32
        Of that choice.
    credit : (n,) float32
        What came after the decision; see `credits`.
    share : float
        Of the mine's cells that its robots have seen in the end, on average.
    """

    scenes: Scenes
    chosen: np.ndarray
    log_chance: np.ndarray
    credit: np.ndarray
    share: float


def join(parts: list[Decisions]) -> Decisions:
    """Return the decisions of several mines as one; their share is the mean."""
    names = ("chosen", "log_chance", "credit")
    arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return Decisions(
        join_scenes([part.scenes for part in parts]), **arrays, share=float(np.mean([p.share for p in parts]))
    )


def sample(sim: MapSimulator, network: Network, discount_s: float, rng: np.random.Generator) -> Decisions:
    """Drive all robots of a simulator through one episode by draws from the softmax of the scores.

    Parameters
    ----------
    sim : MapSimulator
    network : Network
    discount_s : float
        After which a cell counts 1/e.
    rng : np.random.Generator
        For yaws, noise of the beams, and draws.
    """
    scenes: list[Scene] = []
    chosen, log_chance, by, when = [], [], [], []

    def decide(robot: int, situation: Situation) -> int:
        context = sim.context(robot)
        if keeps_goal(situation, context):
            return situation.present
        scene = describe(situation, context)
        found = network.scores(scene)
        drawn = int((found + rng.gumbel(size=len(found))).argmax())
        scenes.append(scene)
        chosen.append(drawn)
        log_chance.append(found[drawn] - found.max() - np.log(np.exp(found - found.max()).sum()))
        by.append(robot)
        when.append(sim.time_s[robot])
        return int(scene.clusters[drawn])

    def choose(asked: np.ndarray, situations: list[Situation]) -> list[int]:
        return [decide(robot, each) for robot, each in zip(asked.tolist(), situations, strict=True)]

    robots = np.arange(sim.count)
    sim.reset(robots, rng.uniform(-np.pi, np.pi, sim.count), rng)
    seen = [sim.cells_seen.copy()]
    for until_s in np.arange(_EVERY_S, sim.horizon_s + _EVERY_S / 2, _EVERY_S):
        sim.run(choose, robots, np.full(sim.count, until_s), rng)
        seen.append(sim.cells_seen.copy())
    worth = credits(np.array(seen, dtype=float), discount_s)
    at = np.minimum((np.array(when) / _EVERY_S).astype(int), len(worth) - 1)
    return Decisions(
        stack_scenes(scenes),
        np.array(chosen),
        np.array(log_chance, np.float32),
        worth[at, np.array(by, dtype=int)].astype(np.float32),
        float(sim.cells_seen.mean() / sim.senses.grid.total),
    )


def credits(seen: np.ndarray, discount_s: float) -> np.ndarray:
    """Return what comes after each moment, above the mean of the mine's robots.

    The credit at time t is the sum over later times u of exp(-(u - t) / discount_s) times the cells seen then. From it
    the mean of all robots at the same moment is subtracted, so that each mine is its own baseline, and the rest is
    divided by the cells that a robot of the mine sees on average within `discount_s`.

    Parameters
    ----------
    seen : (t, n)
        Cells that each robot has seen, every 5 s.
    discount_s : float

    Returns
    -------
    (t - 1, n)
    """
    new = np.diff(seen, axis=0)
    kept, worth = np.exp(-_EVERY_S / discount_s), np.zeros_like(new)
    after = np.zeros(new.shape[1])
    for moment in range(len(new) - 1, -1, -1):
        worth[moment] = after = new[moment] + kept * after
    typical = max(float(new.mean()) * discount_s / _EVERY_S, _LEAST_CELLS)
    return (worth - worth.mean(axis=1, keepdims=True)) / typical
