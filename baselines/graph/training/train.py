"""Train the graph explorer: `python -m baselines.graph.training.train seed=42 improve.updates=200`.

The same command again goes on where a run stopped.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from baselines.base.environments import built_ids, make_env, require_trainable
from baselines.base.errors import BaselineError, need, run_command
from baselines.base.progress import progress_bar
from baselines.base.run_folders import take_run_folder
from baselines.explorers.graph_explorer import Situation
from baselines.graph.checkpoint import write_network
from baselines.graph.choosing import LearnedChoice, Rule, choose_nearest
from baselines.graph.network import told
from baselines.graph.training.episodes import Decisions, Network, join, sample
from baselines.graph.training.fresh_ground import fresh_ground
from baselines.graph.training.settings import GraphSettings, compose_settings
from baselines.graph.training.simulator import MapSimulator
from minexplore.splits import STYLES
from pieces.run import begin_worker

RUNS = Path("artifacts/train")  # NAME/policy.safetensors is found by the evaluation
_WATCHED_ROBOTS = 4
_REPLAN_STEPS = 30  # control steps between plans; 15, as in the environment, take 1.5 times the time


class Run:
    """The folder of a run: `settings.json`, `state.safetensors`, a network a watch, `progress.jsonl`, the policy."""

    def __init__(self, folder: Path, settings: GraphSettings) -> None:
        """Make the folder, or take the one of a run that differs in its length or its processes only.

        Raises
        ------
        BaselineError
            If the folder holds a run of other settings, or files of no run.
        """
        self.path, self.settings = folder, settings
        file = take_run_folder(folder)
        if file.is_file() and _lasting(GraphSettings.model_validate_json(file.read_bytes())) != _lasting(settings):
            raise BaselineError(f"{folder}: holds a run of other settings; remove it, rename it, or give name=OTHER")
        file.write_text(settings.model_dump_json(indent=2) + "\n")

    def network(self, update: int) -> Path:
        """Return the file of the network after an update."""
        return self.path / f"network-{update:05d}.safetensors"

    def state(self, update: int) -> Path:
        """Return the file of weights and optimizer after an update."""
        return self.path / f"state-{update:05d}.safetensors"

    @property
    def done(self) -> int:
        """Return the newest update whose state is kept; -1 without one."""
        return max((int(file.stem.rpartition("-")[2]) for file in self.path.glob("state-*.safetensors")), default=-1)

    def log(self, line: dict[str, Any]) -> None:
        """Add a line to the log, and print it."""
        with (self.path / "progress.jsonl").open("a") as file:
            file.write(json.dumps(line) + "\n")
        print(json.dumps(line), flush=True)


def _lasting(settings: GraphSettings) -> GraphSettings:
    improve = settings.improve.model_copy(update={"updates": 0})
    return settings.model_copy(update={"improve": improve, "jobs": 1})


def train(run: Run) -> Path:
    """Imitate the rule, then improve; return the policy's file. What is done is not done again.

    The policy is the network that saw most in the watched mines; without watched mines it is the last one.

    Raises
    ------
    BaselineError
        If torch is missing, or a mine is not built or one that policies are judged by.
    """
    try:
        from baselines.graph.training.learner import Learner
    except ImportError as error:
        raise need(str(error.name)) from error
    settings, ids = run.settings, built_ids("train", run.settings.mines)
    learned, watched = ids[: len(ids) - settings.watched], ids[len(ids) - settings.watched :]
    if not learned:
        raise BaselineError(f"mines = {settings.mines}, watched = {settings.watched}: no mine is left to learn from")
    learner = Learner(settings.network, settings.seed)
    done = run.done
    if done >= 0:
        learner.load(run.state(done))
    progress = progress_bar(settings.label, settings.improve.updates, max(done, 0), unit="updates")
    with Drivers(settings.jobs) as drivers:
        if done < 0:
            _start(run, learner, drivers, learned)
            _keep(run, learner, drivers, 0, watched)
        for update in range(max(done, 0) + 1, settings.improve.updates + 1):
            figures = _improve(run, learner, drivers, update, learned)
            run.log({"update": update, **figures})
            if update % settings.improve.watch_every == 0 or update == settings.improve.updates:
                _keep(run, learner, drivers, update, watched)
            progress.update(1)
    progress.close()
    policy = run.path / "policy.safetensors"
    policy.write_bytes(_best(run).read_bytes())
    return policy


class Drivers:
    """Processes that drive episodes in mines; with one job this process drives."""

    def __init__(self, jobs: int) -> None:
        """Start the processes."""
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(jobs, context, begin_worker) if jobs > 1 else None

    def map(self, work: Callable[..., Any], *arguments: list[Any]) -> list[Any]:
        """Return what `work` returns for each of the arguments, in their order."""
        return list((self._pool.map if self._pool else map)(work, *arguments))

    def __enter__(self) -> Drivers:
        """Return itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """End the processes, at once after an error."""
        if self._pool is None:
            return
        if kind is not None:
            for worker in multiprocessing.active_children():
                worker.terminate()
        self._pool.shutdown(cancel_futures=True)


def _start(run: Run, learner: Any, drivers: Drivers, ids: list[str]) -> None:
    """Let the network imitate the rule in the first mines."""
    settings, start = run.settings, run.settings.start
    rule = Network(None, settings.network, start.temperature_m)
    driven = _drive(settings, drivers, np.resize(ids, start.mines).tolist(), start.robots, rule, 0)
    tokens = told(settings.network, driven.scenes.tokens)
    logits = np.stack([fresh_ground(each) for each in tokens]) / start.temperature_m
    divergence = learner.imitate(driven.scenes, logits, driven.credit, start)
    run.log({"start": len(logits), "divergence": round(divergence, 4), "share": round(driven.share, 4)})


def _improve(run: Run, learner: Any, drivers: Drivers, update: int, ids: list[str]) -> dict[str, float]:
    """Take one update in some mines; its draws depend on the seed and on the update's number only."""
    settings, improve = run.settings, run.settings.improve
    rng = np.random.default_rng([settings.seed, update])
    is_cave = np.arange(len(ids)) % len(STYLES) == STYLES.index("cave")
    chances = np.where(is_cave, improve.caves, 1.0)
    mines = rng.choice(len(ids), improve.mines, replace=len(ids) < improve.mines, p=chances / chances.sum())
    network = Network(learner.arrays(), settings.network)
    driven = _drive(settings, drivers, [ids[mine] for mine in mines], improve.robots, network, update)
    return {"share": round(driven.share, 4), **learner.improve(driven, improve, update)}


def _drive(
    settings: GraphSettings, drivers: Drivers, ids: list[str], robots: int, network: Network, update: int
) -> Decisions:
    """Return the decisions of robots that explore each of some mines by draws."""
    discount_s = settings.improve.discount_s
    seeds = [(settings.seed, update, 1 + place) for place in range(len(ids))]
    work = partial(_episode, robots=robots, network=network, discount_s=discount_s)
    return join(drivers.map(work, ids, seeds))


def _keep(run: Run, learner: Any, drivers: Drivers, update: int, watched: list[str]) -> None:
    """Watch the network drive, and keep it with the state that the run goes on from."""
    settings, arrays = run.settings, learner.arrays()
    network = Network(arrays, settings.network)
    seen = drivers.map(_watch, watched, [network] * len(watched))
    line: dict[str, Any] = {"update": update, "watched": seen}
    if update == 0:
        line["nearest"] = drivers.map(_watch, watched, [None] * len(watched))
    run.log(line)
    write_network(run.network(update), arrays, settings.network, settings.seed, line)
    learner.save(run.state(update))
    for old in run.path.glob("state-*.safetensors"):
        if old != run.state(update):
            old.unlink()


def _best(run: Run) -> Path:
    """Return the kept network that saw most in the watched mines, or else the last one."""
    lines = [json.loads(line) for line in (run.path / "progress.jsonl").read_text().splitlines()]
    most = run.settings.improve.updates
    kept = {line["update"]: line["watched"] for line in lines if "watched" in line and line["update"] <= most}
    return run.network(max(kept, key=lambda update: (np.mean(kept[update] or [0.0]), update)))


def make_simulator(env_id: str, robots: int) -> MapSimulator:
    """Return a simulator of a mine to train in.

    Raises
    ------
    BaselineError
        If the mine is one that policies are judged by, or has heights, or there is none.
    """
    require_trainable(env_id)
    env = make_env(env_id, 1)
    try:
        return MapSimulator(env.world, env.task, env.robot, robots, _REPLAN_STEPS)
    except ValueError as error:
        raise BaselineError(f"{env_id}: {error}") from error
    finally:
        env.close()


def _episode(env_id: str, seed: tuple[int, ...], robots: int, network: Network, discount_s: float) -> Decisions:
    return sample(make_simulator(env_id, robots), network, discount_s, np.random.default_rng(seed))


def _watch(env_id: str, network: Network | None) -> float:
    """Return the mean share that robots see of a mine; without a network they drive to the nearest cluster."""
    rule: Rule = choose_nearest
    if network is not None and network.arrays is not None:
        rule = LearnedChoice(network.arrays, network.shape)
    sim, rng, robots = make_simulator(env_id, _WATCHED_ROBOTS), np.random.default_rng(0), np.arange(_WATCHED_ROBOTS)
    sim.reset(robots, rng.uniform(-np.pi, np.pi, sim.count), rng)

    def choose(asked: np.ndarray, situations: list[Situation]) -> list[int]:
        return [rule(each, sim.context(i)) for i, each in zip(asked.tolist(), situations, strict=True)]

    sim.run(choose, robots, np.full(sim.count, sim.horizon_s), rng)
    return round(float((sim.cells_seen / sim.senses.grid.total).mean()), 4)


def main() -> None:
    """Compose the settings from the command line and train."""
    settings = compose_settings(sys.argv[1:])
    print(train(Run(RUNS / settings.label, settings)))


if __name__ == "__main__":
    sys.exit(run_command("train-graph", main))
