"""Policy gradient in the simulator: PPO's clipped step, with the mean of robots in the same mine as the baseline.

A decision is credited with the cells that its robot sees in the time after it, minus what the other robots of the mine
see in as much time from the same moment on. The mine is thus its own baseline, and no value has to be learned.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from baselines.explorers.graph_explorer import Situation
from baselines.graph.checkpoint import read_network, write_network
from baselines.graph.choosing import keeps_goal
from baselines.graph.expert import stack_scenes
from baselines.graph.features import Scene, describe
from baselines.graph.fit import arrays_of
from baselines.graph.mines import make_simulator
from baselines.graph.network import Shape, scores
from baselines.graph.settings import GraphSettings, ImproveSettings
from baselines.graph.simulator import MapSimulator
from baselines.graph.torch_network import GraphNetwork

_EVERY_S = 5.0  # at which the cells that a robot has seen are noted
_KEPT_EVERY = 5  # updates between checkpoints


@dataclass
class Episode:
    """The decisions of all robots in one mine, and the cells seen over time."""

    scenes: list[Scene] = field(default_factory=list)
    chosen: list[int] = field(default_factory=list)
    log_chance: list[float] = field(default_factory=list)
    robots: list[int] = field(default_factory=list)
    time_s: list[float] = field(default_factory=list)
    seen: list[np.ndarray] = field(default_factory=list)  # of each robot, every 5 s


def improve(
    folder: Path, settings: GraphSettings, ids: list[str], start: Path, log: Callable[[dict[str, Any]], None]
) -> Path:
    """Improve a network update by update; return the file of the newest one. What is done is not done again."""
    done = sorted(folder.glob("improved-*.safetensors"))
    newest = done[-1] if done else start
    first = int(newest.stem.rpartition("-")[2]) if done else 0
    arrays, shape = read_network(newest)
    network = GraphNetwork(shape)
    network.load_state_dict({name: torch.from_numpy(array) for name, array in arrays.items()})
    optimizer = torch.optim.Adam(network.parameters(), settings.improve.lr)
    for update in range(first + 1, settings.improve.updates + 1):
        rng = np.random.default_rng([settings.seed, 1000, update])
        torch.manual_seed(settings.seed + update)
        sim = make_simulator(ids[int(rng.integers(len(ids)))], settings.improve.robots)
        episode = sample(sim, arrays_of(network), shape, rng)
        figures = learn(network, optimizer, episode, settings.improve)
        log({"update": update, "coverage": round(float((sim.cells_seen / sim.senses.grid.total).mean()), 4), **figures})
        if update % _KEPT_EVERY == 0 or update == settings.improve.updates:
            newest = folder / f"improved-{update:05d}.safetensors"
            write_network(newest, arrays_of(network), shape, settings.seed, {"update": update})
    return newest


def sample(sim: MapSimulator, arrays: dict[str, np.ndarray], shape: Shape, rng: np.random.Generator) -> Episode:
    """Drive all robots of a simulator through one episode by draws from the network's softmax."""
    episode, robots = Episode(), np.arange(sim.count)

    def choose(asked: np.ndarray, situations: list[Situation]) -> list[int]:
        return [decide(robot, each) for robot, each in zip(asked.tolist(), situations, strict=True)]

    def decide(robot: int, situation: Situation) -> int:
        context = sim.context(robot)
        if keeps_goal(situation, context):
            return situation.present
        scene = describe(situation, context)
        found = scores(arrays, shape, scene.tokens, scene.apart_m)
        drawn = int((found + rng.gumbel(size=len(found))).argmax())
        episode.scenes.append(scene)
        episode.chosen.append(drawn)
        episode.log_chance.append(float(found[drawn] - found.max() - np.log(np.exp(found - found.max()).sum())))
        episode.robots.append(robot)
        episode.time_s.append(float(sim.time_s[robot]))
        return int(scene.clusters[drawn])

    sim.reset(robots, rng.uniform(-np.pi, np.pi, sim.count), rng)
    episode.seen.append(sim.cells_seen.copy())
    for until_s in np.arange(_EVERY_S, sim.horizon_s + _EVERY_S / 2, _EVERY_S):
        sim.run(choose, robots, np.full(sim.count, until_s), rng)
        episode.seen.append(sim.cells_seen.copy())
    return episode


def advantages(episode: Episode, horizon_s: float) -> np.ndarray:
    """Return for each decision the cells that it brought above the mine's mean (n,), divided by their deviation."""
    seen, span = np.array(episode.seen, dtype=float), max(round(horizon_s / _EVERY_S), 1)
    later = seen[np.minimum(np.arange(len(seen)) + span, len(seen) - 1)] - seen
    above = later - later.mean(axis=1, keepdims=True)
    when = np.minimum((np.array(episode.time_s) / _EVERY_S).astype(int), len(seen) - 1)
    found = above[when, episode.robots]
    return found / max(float(found.std()), 1.0)


def learn(
    network: GraphNetwork, optimizer: torch.optim.Optimizer, episode: Episode, settings: ImproveSettings
) -> dict[str, float]:
    """Take PPO's clipped steps on the decisions of an episode."""
    tokens, apart, real = (torch.from_numpy(array) for array in stack_scenes(episode.scenes))
    chosen, before = torch.tensor(episode.chosen), torch.tensor(episode.log_chance)
    gain = torch.from_numpy(advantages(episode, settings.horizon_s)).float()
    entropies = []
    for _ in range(settings.epochs):
        for some in torch.randperm(len(chosen)).split(settings.batch):
            log_chances = network(tokens[some], apart[some], real[some])[0].log_softmax(dim=1)
            ratio = (log_chances.gather(1, chosen[some, None])[:, 0] - before[some]).exp()
            clipped = ratio.clamp(1 - settings.clip, 1 + settings.clip)
            entropy = -(log_chances.exp() * log_chances.clamp(min=-50)).sum(dim=1).mean()
            loss = -torch.minimum(ratio * gain[some], clipped * gain[some]).mean() - settings.entropy * entropy
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 0.5)
            optimizer.step()
            entropies.append(float(entropy.detach()))
    return {"decisions": len(chosen), "entropy": round(float(np.mean(entropies)), 3)}
