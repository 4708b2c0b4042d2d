"""What a training run has done so far: its steps, its episodes, and whether it should stop."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from baselines.ppo.settings import Stop, TrainSettings
from baselines.ppo.training_env import FIGURES

POLICY = "default_policy"  # RLlib's name of a single policy


@dataclass
class History:
    """Counts, episodes and the best rolling coverage of a run."""

    stop: Stop
    steps: int = 0
    iteration: int = 0
    episodes: list[dict[str, float]] = field(default_factory=list)
    best: float = 0.0

    def take_line(self, line: dict[str, Any]) -> None:
        """Add an iteration that was written to the log."""
        self.steps, self.iteration = line["steps"], line["iteration"]
        self.episodes += line["episodes"]
        self.best = max(self.best, line["best_rolling_coverage"])

    def take_result(self, result: dict[str, Any], seconds: float) -> dict[str, Any]:
        """Add an iteration as RLlib returns it; return its line of the log."""
        sampled = int(result["env_runners"]["num_env_steps_sampled"])
        episodes = _episodes_of(result["env_runners"].get("episodes") or {})
        self.iteration += 1
        self.steps += sampled
        self.episodes += episodes
        rolling, learner = self.rolling(), result["learners"][POLICY]
        if len(self.episodes) >= self.stop.window and rolling["coverage"] is not None:
            self.best = max(self.best, rolling["coverage"])
        return {
            "iteration": self.iteration,
            "steps": self.steps,
            "seconds": round(seconds, 3),
            "steps_per_s": round(sampled / seconds, 1),
            "entropy": round(float(learner["entropy"]), 4),
            "kl": round(float(learner["mean_kl_loss"]), 5) if "mean_kl_loss" in learner else None,
            "value_explained": round(float(learner["vf_explained_var"]), 4),
            "rolling_coverage": rolling["coverage"],
            "rolling_return": rolling["return"],
            "rolling_collisions": rolling["collisions"],
            "best_rolling_coverage": self.best,
            "episodes": episodes,
        }

    def rolling(self) -> dict[str, float | None]:
        """Return the mean figures of the last episodes; None before the first one has ended."""
        recent = self.episodes[-self.stop.window :]
        return {k: round(float(np.mean([e[k] for e in recent])), 4) if recent else None for k in FIGURES}

    def stop_reason(self, settings: TrainSettings) -> str | None:
        """Return why the run should end now: `target coverage`, `coverage drop`, `steps`, or None."""
        coverage = self.rolling()["coverage"]
        if len(self.episodes) >= self.stop.window and coverage is not None:
            if coverage >= self.stop.coverage:
                return "target coverage"
            if self.steps >= self.stop.after and coverage <= self.best - self.stop.drop:
                return "coverage drop"
        return "steps" if self.steps >= settings.steps else None


def _episodes_of(ended: dict[str, Any]) -> list[dict[str, float]]:
    """Return the figures of the episodes that ended; RLlib gives a list, a number for one episode, NaN for none."""
    series = [np.atleast_1d(np.asarray(ended.get(name, []), dtype=float)) for name in FIGURES]
    rows = [row for row in zip(*series, strict=True) if not np.isnan(row).any()]
    return [dict(zip(FIGURES, map(float, row), strict=True)) for row in rows]
