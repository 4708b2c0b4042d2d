"""Train the graph explorer: `python -m baselines.graph.train seed=42 labels.rounds=3`; run it again to go on."""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from baselines.errors import BaselineError, need, run_command
from baselines.explorers.graph_explorer import Situation
from baselines.graph.checkpoint import read_network, write_network
from baselines.graph.choosing import LearnedChoice, Rule, choose_nearest, keeps_goal
from baselines.graph.expert import Expert, Trial
from baselines.graph.features import Context
from baselines.graph.label_files import read_labels, write_labels
from baselines.graph.mines import make_simulator, training_ids
from baselines.graph.settings import GraphSettings, compose_settings
from baselines.graph.watch import drive
from baselines.progress import Progress

RUNS = Path("artifacts/train")  # NAME/policy.safetensors is found by the evaluation
_WATCHED_ROBOTS = 4


class Run:
    """The folder of a run: `settings.json`, `labels/`, a network a round, `progress.jsonl`, `policy.safetensors`."""

    def __init__(self, folder: Path, settings: GraphSettings) -> None:
        """Make the folder, or take the one of a run that differs in its length only.

        Raises
        ------
        BaselineError
            If the folder holds a run of other settings.
        """
        self.path, self.settings = folder, settings
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / "settings.json"
        if file.is_file() and _without_length(GraphSettings.model_validate_json(file.read_bytes())) != _without_length(
            settings
        ):
            raise BaselineError(f"{folder}: holds a run of other settings; remove it, rename it, or give name=OTHER")
        file.write_text(settings.model_dump_json(indent=2) + "\n")

    def network(self, stage: str) -> Path:
        """Return the file of the network that a stage ends with."""
        return self.path / f"network-{stage}.safetensors"

    def shard(self, number: int, mine: int) -> Path:
        """Return the file of the labels of one mine of a round."""
        return self.path / "labels" / f"{number:02d}-{mine:03d}.npz"

    def log(self, line: dict[str, Any]) -> None:
        """Add a line to the log, and print it."""
        with (self.path / "progress.jsonl").open("a") as file:
            file.write(json.dumps(line) + "\n")
        print(json.dumps(line), flush=True)


def _without_length(settings: GraphSettings) -> GraphSettings:
    labels = settings.labels.model_copy(update={"rounds": 1, "mines": 1})
    improve = settings.improve.model_copy(update={"updates": 0})
    return settings.model_copy(update={"labels": labels, "improve": improve})


def train(run: Run) -> Path:
    """Label and fit round by round, then improve; return the policy's file. What is done is not done again.

    Raises
    ------
    BaselineError
        If torch is missing, or a mine is not built or one that policies are judged by.
    """
    settings, ids = run.settings, training_ids(run.settings.mines)
    learned, watched = ids[: len(ids) - settings.watched], ids[len(ids) - settings.watched :]
    if not learned:
        raise BaselineError(f"mines = {settings.mines}, watched = {settings.watched}: no mine is left to learn from")
    newest = run.network("00")
    for number in range(settings.labels.rounds):
        newest = run.network(f"{number:02d}")
        if not newest.is_file():
            _label(run, number, learned)
            _fit(run, number, watched)
    if settings.improve.updates:
        from baselines.graph.improve import improve

        newest = improve(run.path, settings, learned, newest, run.log)
    arrays, shape = read_network(newest)
    policy = run.path / "policy.safetensors"
    write_network(policy, arrays, shape, settings.seed, {"network": newest.name})
    return policy


def _label(run: Run, number: int, ids: list[str]) -> None:
    """Write the labels of a round, mine by mine."""
    settings, labels = run.settings, run.settings.labels
    order = np.random.default_rng([settings.seed, number]).permutation(len(ids))
    drawn = np.resize(order, labels.mines)
    trial = Trial(labels.robots, labels.clusters, labels.horizon_s, labels.every_s, labels.wander)
    progress = Progress(f"{settings.label}, labels {number}", len(drawn), unit="mines")
    for mine, which in enumerate(drawn.tolist()):
        path = run.shard(number, mine)
        if not path.is_file():
            rng = np.random.default_rng([settings.seed, number, mine])
            sim = make_simulator(ids[which], labels.robots * (1 + labels.clusters))
            behaviour, after = _rules(run, number)
            write_labels(path, Expert(sim, trial, behaviour, after, rng).label_episode())
        progress.add(1)
    progress.close()


def _rules(run: Run, number: int) -> tuple[Rule, Rule]:
    """Return what drives between scenes and what drives after a trial: first the nearest cluster, then the network."""
    if number == 0:
        return follow_nearest, choose_nearest
    choice = LearnedChoice(*read_network(run.network(f"{number - 1:02d}")))
    return choice, choice


def follow_nearest(situation: Situation, context: Context) -> int:
    """Return the nearest cluster; a goal is kept as the learned explorer keeps it."""
    return situation.present if keeps_goal(situation, context) else choose_nearest(situation, context)


def _fit(run: Run, number: int, watched: list[str]) -> None:
    """Fit a network to the labels of all rounds so far, and watch it drive."""
    try:
        from baselines.graph.fit import arrays_of, fit
    except ImportError as error:
        raise need(str(error.name)) from error
    settings, start = run.settings, time.process_time()
    shards = [run.shard(n, mine) for n in range(number + 1) for mine in range(settings.labels.mines)]
    network, figures = fit(read_labels(shards), settings.network, settings.fit, settings.seed)
    arrays = arrays_of(network)
    seen = watch(LearnedChoice(arrays, settings.network), watched)
    line = {"round": number, **figures, "watched": seen, "nearest": watch(choose_nearest, watched)}
    run.log({**line, "fit_and_watch_s": round(time.process_time() - start, 1)})
    write_network(run.network(f"{number:02d}"), arrays, settings.network, settings.seed, line)


def watch(rule: Rule, ids: list[str]) -> list[float]:
    """Return the mean share that robots of a rule see of each mine."""
    return [round(float(drive(make_simulator(env_id, _WATCHED_ROBOTS), rule, 0).mean()), 4) for env_id in ids]


def main() -> None:
    """Compose the settings from the command line and train."""
    settings = compose_settings(sys.argv[1:])
    print(train(Run(RUNS / settings.label, settings)))


if __name__ == "__main__":
    sys.exit(run_command("train-graph", main))
