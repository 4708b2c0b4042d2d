"""Train PPO: `python -m baselines.ppo.train seed=42 env=entrance observation=map`; run it again to go on."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tqdm import tqdm

from baselines.base.environments import make_env
from baselines.base.errors import interrupt, need, run_command
from baselines.base.progress import progress_bar
from baselines.policies.policy_lookup import TRAINED
from baselines.ppo.history import POLICY, History
from baselines.ppo.run_folder import RunFolder
from baselines.ppo.settings import TrainSettings, compose_settings
from baselines.ppo.training_env import training_mines

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
_SCALARS = ("rolling_coverage", "rolling_return", "rolling_collisions", "entropy", "steps_per_s")
_GRACE_S = 3.0  # for the iteration under way when a run is ended


def train(
    settings: TrainSettings, folder: Path, start: Callable[[TrainSettings, RunFolder, History], Any] | None = None
) -> dict[str, Any]:
    """Train until a stop of the settings; what was reached is written and returned.

    `start` returns the algorithm, RLlib's by default, restored from the run's checkpoint if there is one.

    A folder holds `settings.json`, `progress.jsonl` (a line an iteration, with every episode that ended in it),
    TensorBoard's events, the newest checkpoint, and at the end `policy.safetensors` and `reached.json`. A run that was
    ended goes on from its checkpoint. `RAY_ADDRESS` names a cluster to sample on, with `runners` above 0.

    Raises
    ------
    BaselineError
        If Ray or torch is missing, or the folder holds a run of other settings.
    KeyboardInterrupt
        If the run is ended by SIGINT or SIGTERM; its checkpoint is written first.
    """
    run = RunFolder(folder, settings)
    reached = run.reached()
    if reached is not None:
        return reached
    history = run.read_history()
    progress = progress_bar(settings.name, settings.steps, history.steps)
    try:
        algorithm = (start or _start)(settings, run, history)
        stop = _iterate(algorithm, settings, run, history, progress)
    finally:
        progress.close()
    facts = {
        "run": folder.name,
        "stop": stop,
        "steps": history.steps,
        "episodes": len(history.episodes),
        "final_coverage": history.rolling()["coverage"],
        "best_rolling_coverage": round(history.best, 4),
    }
    _export(algorithm, settings, facts, run)
    algorithm.stop()
    return facts


def _start(settings: TrainSettings, run: RunFolder, history: History) -> Any:
    """Start Ray and return the algorithm, restored from the run's checkpoint if there is one."""
    try:
        import ray
        import torch

        from baselines.ppo.algorithm import build_algorithm
    except ImportError as error:
        raise need(str(error.name)) from error
    torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))
    if not ray.is_initialized():
        ray.init(
            address=os.environ.get("RAY_ADDRESS"),
            include_dashboard=False,
            logging_level="ERROR",
            runtime_env={"env_vars": {"PYTHONPATH": str(Path.cwd())}},
        )
        signal.signal(signal.SIGTERM, interrupt)  # Ray has set a handler of its own
    algorithm = build_algorithm(settings, history.steps)
    if run.checkpoint.is_dir():
        algorithm.restore_from_path(str(run.checkpoint.resolve()))
    return algorithm


def _iterate(algorithm: Any, settings: TrainSettings, run: RunFolder, history: History, progress: tqdm) -> str:
    """Iterate until there is a reason to stop, and return it."""
    from tensorboardX import SummaryWriter

    writer = SummaryWriter(str(run.path / "tensorboard"))
    stop = None
    try:
        with run.log.open("a") as log, _asked_to_end() as asked:
            while stop is None:
                start = time.perf_counter()
                line = history.take_result(algorithm.train(), time.perf_counter() - start)
                log.write(json.dumps(line) + "\n")
                log.flush()
                for key in _SCALARS:
                    if line[key] is not None:
                        writer.add_scalar(key, line[key], line["steps"])
                if line["rolling_coverage"] is not None:
                    share, returned = 100 * line["rolling_coverage"], line["rolling_return"]
                    progress.set_postfix({"coverage": f"{share:.1f} %", "return": f"{returned:.1f}"}, refresh=False)
                progress.update(history.steps - progress.n)
                stop = history.stop_reason(settings)
                if stop is not None or history.iteration % settings.checkpoint_every == 0:
                    run.save(algorithm)
                if asked:
                    raise KeyboardInterrupt
    except KeyboardInterrupt:
        run.save(algorithm)
        raise
    finally:
        writer.close()
    return stop


@contextmanager
def _asked_to_end() -> Iterator[list[int]]:
    """Yield the signals that asked for the end; it comes at once after the second one or when the grace is over."""
    asked: list[int] = []

    def ask(kind: int, frame: object) -> None:
        if asked:
            raise KeyboardInterrupt
        asked.append(kind)
        signal.setitimer(signal.ITIMER_REAL, _GRACE_S)

    kinds = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)
    before = [signal.signal(kind, ask) for kind in kinds]
    try:
        yield asked
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        for kind, handler in zip(kinds, before, strict=True):
            signal.signal(kind, handler)


def _export(algorithm: Any, settings: TrainSettings, facts: dict[str, Any], run: RunFolder) -> None:
    from baselines.ppo.export import export_policy

    export_policy(algorithm.get_module(POLICY), settings, facts, run.policy)
    run.write_reached(facts)


def main() -> None:
    """Compose the settings from the command line and train."""
    settings = compose_settings(sys.argv[1:])
    first = training_mines(settings.env, settings.mines)[0]
    make_env(first, 1).close()  # a world that is not built is refused before Ray starts
    facts = train(settings, TRAINED / settings.name)
    print(json.dumps(facts))


if __name__ == "__main__":
    sys.exit(run_command("train", main))
