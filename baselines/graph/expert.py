"""The privileged expert: what each cluster is worth by driving to it in the true mine and going on by a simple rule."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from baselines.explorers.graph_explorer import Situation
from baselines.graph.choosing import Rule, choose_nearest, keeps_goal
from baselines.graph.features import MOST, NAMES, Context, Scene, describe
from baselines.graph.simulator import MapSimulator

_HOLD_S = 15.0  # for which a tried cluster stays the goal, unless it is seen or the robot stands still


@dataclass(frozen=True)
class Labels:
    """Scenes, filled up to `MOST` clusters, and how many cells were seen after driving to each of some clusters.

    Attributes
    ----------
    tokens : (n, MOST, len(NAMES)) float32
    apart_m : (n, MOST, MOST) float32
    real : (n, MOST) bool
        False for what is filled in.
    cells : (n, MOST) float32
        New cells within the horizon; NaN for clusters that were not tried.
    """

    tokens: np.ndarray
    apart_m: np.ndarray
    real: np.ndarray
    cells: np.ndarray


def stack_scenes(scenes: list[Scene]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return tokens, path lengths and which clusters are real, filled up to `MOST` clusters."""
    tokens = np.zeros((len(scenes), MOST, len(NAMES)), np.float32)
    apart, real = np.zeros((len(scenes), MOST, MOST), np.float32), np.zeros((len(scenes), MOST), dtype=bool)
    for i, scene in enumerate(scenes):
        count = len(scene.clusters)
        tokens[i, :count], apart[i, :count, :count], real[i, :count] = scene.tokens, scene.apart_m, True
    return tokens, apart, real


@dataclass(frozen=True)
class Trial:
    """How the expert tries: robots at a time, clusters of each scene, horizon, and pause between scenes."""

    robots: int
    clusters: int
    horizon_s: float
    every_s: tuple[float, float]
    wander: float  # chance that a robot drives to a random cluster instead of the chosen one


class Expert:
    """Labels the scenes that robots come into in one mine; all robots and trials share one simulator."""

    def __init__(self, sim: MapSimulator, trial: Trial, behaviour: Rule, after: Rule, rng: np.random.Generator) -> None:
        """Take a simulator of `robots * (1 + clusters)` robots; `after` drives when a tried cluster was reached."""
        self._sim, self._trial, self._behaviour, self._after, self._rng = sim, trial, behaviour, after, rng
        self._held = np.zeros(sim.count, dtype=bool)  # robots on the way to a cluster that is tried

    def label_episode(self) -> Labels:
        """Drive the robots through one episode and label scenes on the way."""
        sim, rng, robots = self._sim, self._rng, np.arange(self._trial.robots)
        sim.reset(robots, rng.uniform(-np.pi, np.pi, len(robots)), rng)
        until, scenes, cells = np.zeros(sim.count), [], []
        end_s = sim.horizon_s - self._trial.every_s[0]
        while True:
            until[robots] += rng.uniform(*self._trial.every_s, len(robots))
            robots = robots[until[robots] < end_s]
            if not len(robots):
                break
            sim.run(self._choose, robots, until, rng)
            for scene, seen in self._try_clusters(robots):
                scenes.append(scene)
                cells.append(seen)
        return Labels(*stack_scenes(scenes), np.array(cells, np.float32).reshape(-1, MOST))

    def _choose(self, robots: np.ndarray, situations: list[Situation]) -> list[int]:
        return [self._choose_one(*each) for each in zip(robots.tolist(), situations, strict=True)]

    def _choose_one(self, robot: int, situation: Situation) -> int:
        context = self._sim.context(robot)
        if robot >= self._trial.robots:
            self._held[robot] &= keeps_goal(situation, context, _HOLD_S)
            return situation.present if self._held[robot] else self._after(situation, context)
        if self._rng.random() < self._trial.wander and not keeps_goal(situation, context):
            return int(self._rng.integers(len(situation.goals)))
        return self._behaviour(situation, context)

    def _try_clusters(self, robots: np.ndarray) -> list[tuple[Scene, np.ndarray]]:
        """Return the scenes of robots (k,), and the cells that driving to each cluster brought (MOST,)."""
        sim, each = self._sim, self._trial.clusters
        found: list[tuple[int, Scene, np.ndarray, np.ndarray]] = []
        for robot in robots.tolist():
            situation = sim.planners[robot].look_around(sim.poses[robot, :2])
            if situation is None or len(situation.goals) < 2:
                continue
            scene = describe(situation, sim.context(robot))
            tried = self._some(scene, situation, sim.context(robot))
            slots = self._trial.robots + robot * each + np.arange(len(tried))
            sim.fork(robot, slots)
            for slot, which in zip(slots.tolist(), tried.tolist(), strict=True):
                sim.send(slot, situation, int(scene.clusters[which]))
                sim.planners[slot].steps_to_goal = 0
            self._held[slots] = True
            found.append((robot, scene, tried, slots))
        if not found:
            return []
        trying = np.concatenate([slots for *_, slots in found])
        before, until = sim.cells_seen.copy(), np.minimum(sim.time_s + self._trial.horizon_s, sim.horizon_s)
        sim.run(self._choose, trying, until, self._rng)
        labelled = []
        for robot, scene, tried, slots in found:
            cells = np.full(MOST, np.nan)
            cells[tried] = sim.cells_seen[slots] - before[robot]
            labelled.append((scene, cells))
        return labelled

    def _some(self, scene: Scene, situation: Situation, context: Context) -> np.ndarray:
        """Return which clusters of a scene to try: the nearest, the present one, and others by chance."""
        first = [0, *np.flatnonzero(scene.clusters == situation.present).tolist()]
        nearest = np.flatnonzero(scene.clusters == choose_nearest(situation, context)).tolist()
        others = self._rng.permutation(len(scene.clusters)).tolist()
        return np.array(list(dict.fromkeys([*first, *nearest, *others]))[: self._trial.clusters])
