"""Train PPO: `python -m baselines.ppo.train seed=42 env=entrance observation=map`; run it again to go on."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from baselines.errors import BaselineError, need, run_command
from baselines.ppo.settings import TrainSettings, compose_settings
from baselines.ppo.training_env import FIGURES
from baselines.protocol import make_env

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
RUNS = Path("artifacts/train")
_MODULE = "default_policy"


def train(settings: TrainSettings, folder: Path) -> dict[str, Any]:
    """Train until a stop of the settings; what was reached is written and returned.

    A folder holds `settings.json`, `progress.jsonl` (a line an iteration, with every episode that ended in it),
    TensorBoard's events, the newest checkpoint, and at the end `policy.safetensors` and `reached.json`. A run that was
    ended goes on from its checkpoint. `RAY_ADDRESS` names a cluster to sample on, with `runners` above 0.

    Raises
    ------
    BaselineError
        If Ray or torch is missing, or the folder holds a run of other settings.
    """
    try:
        import ray
        import torch
        from tensorboardX import SummaryWriter

        from baselines.ppo.algorithm import build_algorithm
        from baselines.ppo.export import export_policy
    except ImportError as error:
        raise need(str(error.name)) from error
    reached = folder / "reached.json"
    _claim(folder, settings)
    if reached.is_file():
        return json.loads(reached.read_text())
    torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))
    if not ray.is_initialized():
        ray.init(
            address=os.environ.get("RAY_ADDRESS"), include_dashboard=False, logging_level="ERROR",
            runtime_env={"env_vars": {"PYTHONPATH": str(Path.cwd())}},
        )  # fmt: skip
    for kind in (signal.SIGINT, signal.SIGTERM):  # both save first; Ray has set a handler of its own
        signal.signal(kind, _interrupt)
    history = _read_progress(folder)
    algorithm = build_algorithm(settings, history["steps"])
    checkpoint = folder / "checkpoint"
    if checkpoint.is_dir():
        algorithm.restore_from_path(str(checkpoint.resolve()))
    writer = SummaryWriter(str(folder / "tensorboard"))
    stop = None
    bar = tqdm(total=settings.steps, initial=history["steps"], desc=settings.name, unit=" steps", disable=None)
    try:
        with (folder / "progress.jsonl").open("a") as log:
            while stop is None:
                start = time.perf_counter()
                result = algorithm.train()
                line = _line(result, history, settings.stop.window, time.perf_counter() - start)
                log.write(json.dumps(line) + "\n")
                log.flush()
                for key in ("rolling_coverage", "rolling_return", "rolling_collisions", "entropy", "steps_per_s"):
                    if line[key] is not None:
                        writer.add_scalar(key, line[key], line["steps"])
                bar.update(line["steps"] - bar.n)
                bar.set_postfix(coverage=line["rolling_coverage"], refresh=False)
                stop = _stop(settings, history)
                if stop is not None or line["iteration"] % settings.checkpoint_every == 0:
                    _save(algorithm, checkpoint)
    except KeyboardInterrupt:
        _save(algorithm, checkpoint)
        raise
    finally:
        bar.close()
        writer.close()
    facts = {
        "run": settings.name, "stop": stop, "steps": history["steps"], "episodes": len(history["episodes"]),
        "final_coverage": _rolling(history, settings, "coverage"), "best_rolling_coverage": round(history["best"], 4),
    }  # fmt: skip
    export_policy(algorithm.get_module(_MODULE), settings, facts, folder / "policy.safetensors")
    reached.write_text(json.dumps(facts, indent=2) + "\n")
    algorithm.stop()
    return facts


def _claim(folder: Path, settings: TrainSettings) -> None:
    """Make a run's folder, or check that it is of the same settings; more steps may be asked for."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "settings.json"
    if file.is_file():
        then = TrainSettings.model_validate_json(file.read_bytes())
        if then.model_copy(update={"steps": settings.steps}) != settings:
            changed = [k for k, v in then.model_dump().items() if v != settings.model_dump()[k] and k != "steps"]
            raise BaselineError(
                f"{folder}: holds a run of other settings ({', '.join(changed)}); remove it or rename it"
            )
        if settings.steps > then.steps:
            (folder / "reached.json").unlink(missing_ok=True)
    file.write_text(settings.model_dump_json(indent=2) + "\n")


def _read_progress(folder: Path) -> dict[str, Any]:
    """Return what a run has done up to its checkpoint; lines beyond it are dropped, as they will be done again."""
    history: dict[str, Any] = {"steps": 0, "iteration": 0, "episodes": [], "best": 0.0}
    file, mark = folder / "progress.jsonl", folder / "checkpoint" / "iteration.txt"
    upto = int(mark.read_text()) if mark.is_file() else 0
    lines = [json.loads(line) for line in file.read_text().splitlines() if line.endswith("}")] if file.is_file() else []
    kept = [line for line in lines if line["iteration"] <= upto]
    file.write_text("".join(json.dumps(line) + "\n" for line in kept))
    for line in kept:
        history["steps"], history["iteration"] = line["steps"], line["iteration"]
        history["episodes"] += line["episodes"]
        history["best"] = max(history["best"], line["best_rolling_coverage"])
    return history


def _line(result: dict[str, Any], history: dict[str, Any], span: int, seconds: float) -> dict[str, Any]:
    """Return an iteration's line and bring the history up to date."""
    sampled = int(result["env_runners"]["num_env_steps_sampled"])
    ended = result["env_runners"].get("episodes", {})  # RLlib says NaN where no episode ended
    series = [ended[name] if isinstance(ended.get(name), list) else [] for name in FIGURES]
    rows = [dict(zip(FIGURES, map(float, row), strict=True)) for row in zip(*series, strict=True)]
    history["iteration"] += 1
    history["steps"] += sampled
    history["episodes"] += rows
    learner = result["learners"][_MODULE]
    recent = history["episodes"][-span:]
    rolling = {k: round(float(np.mean([e[k] for e in recent])), 4) if recent else None for k in FIGURES}
    if len(history["episodes"]) >= span:
        history["best"] = max(history["best"], rolling["coverage"])
    return {
        "iteration": history["iteration"], "steps": history["steps"], "seconds": round(seconds, 3),
        "steps_per_s": round(sampled / seconds, 1), "entropy": round(float(learner["entropy"]), 4),
        "kl": round(float(learner.get("mean_kl_loss", float("nan"))), 5) if "mean_kl_loss" in learner else None,
        "value_explained": round(float(learner["vf_explained_var"]), 4),
        "rolling_coverage": rolling["coverage"], "rolling_return": rolling["return"],
        "rolling_collisions": rolling["collisions"], "best_rolling_coverage": history["best"], "episodes": rows,
    }  # fmt: skip


def _rolling(history: dict[str, Any], settings: TrainSettings, figure: str) -> float | None:
    recent = [e[figure] for e in history["episodes"][-settings.stop.window :]]
    return round(float(np.mean(recent)), 4) if recent else None


def _stop(settings: TrainSettings, history: dict[str, Any]) -> str | None:
    """Return why a run should end now: `target coverage`, `coverage drop`, `steps`, or None."""
    stop = settings.stop
    if len(history["episodes"]) >= stop.window:
        rolling = _rolling(history, settings, "coverage")
        assert rolling is not None
        if rolling >= stop.coverage:
            return "target coverage"
        if history["steps"] >= stop.after and rolling <= history["best"] - stop.drop:
            return "coverage drop"
    return "steps" if history["steps"] >= settings.steps else None


def _save(algorithm: Any, checkpoint: Path) -> None:
    """Write a checkpoint beside the last one, then take its place."""
    fresh = checkpoint.with_name("checkpoint.new")
    shutil.rmtree(fresh, ignore_errors=True)
    algorithm.save_to_path(str(fresh.resolve()))
    (fresh / "iteration.txt").write_text(str(algorithm.training_iteration))
    shutil.rmtree(checkpoint, ignore_errors=True)
    fresh.rename(checkpoint)


def _interrupt(kind: int, frame: object) -> None:
    raise KeyboardInterrupt


def main() -> None:
    """Compose the settings from the command line and train."""
    settings = compose_settings(sys.argv[1:])
    make_env(settings.env, 1).close()  # an unknown id is refused before Ray starts
    facts = train(settings, RUNS / settings.name)
    print(json.dumps(facts))


if __name__ == "__main__":
    sys.exit(run_command("train", main))
