"""Training curves, and the table of runs beside the paper's: `python -m baselines.ppo.curves`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from pydantic import ValidationError

from baselines.base.errors import BaselineError, run_command
from baselines.base.markdown import markdown_table, write_table
from baselines.policies.policy_lookup import TRAINED
from baselines.ppo.settings import TrainSettings

matplotlib.use("Agg")
import matplotlib.pyplot as plt

KEPT = Path("baselines/results/training")
_PAPER = {
    42: ("TC", 257, 100.00, 89.79),
    142: ("ED", 962, 70.05, 85.43),
    242: ("ED", 416, 70.77, 89.39),
    342: ("TC", 432, 89.83, 89.95),
    442: ("TC", 282, 92.00, 89.88),
}
_PAPER_MEAN = "84.53, 12.02; 88.89, 1.74 (population SD)"
_HEADLINE = "ChileanMineEntrance-beams-mlp"
_STOPS = {"target coverage": "TC", "coverage drop": "ED", "steps": "steps"}
_AXES = (
    ("rolling_coverage", "coverage"),
    ("rolling_collisions", "steps in contact with rock, an episode"),
    ("rolling_return", "return, the paper's reward"),
)
_POINTS = 200
_PAGE = Path("docs/evidence/parts/training.md")
_COLUMNS = (
    *("run", "seed", "stop", "steps", "episodes", "final coverage, %", "best rolling, %", "steps/s", "minutes"),
    "paper: stop, episodes, final, best",
)


def keep(runs: Path = TRAINED, kept: Path = KEPT) -> None:
    """Write the points of all runs' logs that the curves need, few enough to be tracked by git."""
    for progress in sorted(runs.glob("*/progress.jsonl")):
        lines = [json.loads(line) for line in progress.read_text().splitlines()]
        if not lines:
            continue
        try:
            settings = TrainSettings.model_validate_json((progress.parent / "settings.json").read_bytes())
        except ValidationError:
            continue  # a run of the graph explorer
        picked = sorted({round(i) for i in np.linspace(0, len(lines) - 1, _POINTS)})
        reached, last = progress.parent / "reached.json", lines[-1]
        record = {
            "run": progress.parent.name,
            "seed": settings.seed,
            "env": settings.env,
            "settings": settings.model_dump(mode="json"),
            "stop": json.loads(reached.read_text())["stop"] if reached.is_file() else "unfinished",
            "steps": last["steps"],
            "episodes": sum(len(line["episodes"]) for line in lines),
            "steps_per_s": round(float(np.median([line["steps_per_s"] for line in lines])), 1),
            "final_coverage": last["rolling_coverage"],
            "best_rolling_coverage": last["best_rolling_coverage"],
            "points": {k: [lines[i][k] for i in picked] for k in ("steps", *(name for name, _ in _AXES))},
        }
        kept.mkdir(parents=True, exist_ok=True)
        (kept / f"{progress.parent.name}.json").write_text(json.dumps(record) + "\n")


def read_runs(kept: Path = KEPT) -> dict[str, list[dict[str, Any]]]:
    """Return the runs by environment, observation and model, each group sorted by seed.

    Raises
    ------
    BaselineError
        If there is no run.
    """
    runs: dict[str, list[dict[str, Any]]] = {}
    for file in sorted(kept.glob("*.json")):
        record = json.loads(file.read_text())
        runs.setdefault(record["run"].rsplit("-", 1)[0], []).append(record)
    if not runs:
        raise BaselineError(f"{kept}: no runs; `python -m benchmarks train seed=42` makes one")
    return {name: sorted(group, key=lambda r: r["seed"]) for name, group in runs.items()}


def draw_curves(runs: dict[str, list[dict[str, Any]]], path: Path) -> None:
    """Draw coverage, collisions and return over training: mean and standard deviation over seeds."""
    figure, axes = plt.subplots(1, 3, figsize=(13, 3.8), layout="constrained")
    for axis, (key, label) in zip(axes, _AXES, strict=True):
        for number, (name, group) in enumerate(runs.items()):
            colour = f"C{number}"  # of matplotlib's cycle
            end = min(r["points"]["steps"][-1] for r in group)
            steps = np.geomspace(1e4, end, _POINTS)  # 16,384 robots on a GPU take 40 times the steps of 16 on a CPU
            curves = np.array([_along(steps, r["points"]["steps"], r["points"][key]) for r in group])
            middle, spread = curves.mean(axis=0), curves.std(axis=0, ddof=1) if len(group) > 1 else np.zeros(_POINTS)
            axis.plot(steps / 1e6, middle, color=colour, label=f"{name}, {len(group)} seed{'s' * (len(group) > 1)}")
            axis.fill_between(steps / 1e6, middle - spread, middle + spread, color=colour, alpha=0.2, lw=0)
        axis.set(xlabel="environment steps, millions", ylabel=label, xscale="log", xlim=(0.01, None))
    axes[0].axhline(0.9, color="#222222", ls=":", lw=1)
    axes[1].set_yscale("symlog", linthresh=1)
    axes[2].set_yscale("symlog", linthresh=20)
    axes[0].legend(frameon=False, fontsize=6)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _along(at: np.ndarray, steps: list[float], values: list[float | None]) -> np.ndarray:
    known = np.array([(s, v) for s, v in zip(steps, values, strict=True) if v is not None])
    return np.interp(at, known[:, 0], known[:, 1])


def table(runs: dict[str, list[dict[str, Any]]]) -> str:
    """Return the runs as a Markdown table, with the paper's Table I beside the five seeds."""
    rows: list[tuple[Any, ...]] = []
    for name, group in runs.items():
        headline = name == _HEADLINE
        for r in group:
            rows.append(
                (
                    name,
                    r["seed"],
                    _STOPS.get(r["stop"], r["stop"]),
                    f"{r['steps']:,}",
                    f"{r['episodes']:,}",
                    f"{100 * r['final_coverage']:.2f}",
                    f"{100 * r['best_rolling_coverage']:.2f}",
                    f"{r['steps_per_s']:,.0f}",
                    f"{r['steps'] / r['steps_per_s'] / 60:.1f}",
                    ", ".join(map(str, _PAPER[r["seed"]])) if headline and r["seed"] in _PAPER else "",
                )
            )
        if len(group) > 1:
            final, best = (np.array([100 * r[k] for r in group]) for k in ("final_coverage", "best_rolling_coverage"))
            spread = (f"{v.mean():.2f}, {v.std(ddof=1):.2f}" for v in (final, best))
            rows.append((name, "mean, SD", "", "", "", *spread, "", "", _PAPER_MEAN if headline else ""))
    return markdown_table(_COLUMNS, rows)


def main() -> None:
    """Keep what the curves need, draw them, write the table."""
    keep()
    runs = read_runs()
    draw_curves(runs, Path("docs/training.png"))
    write_table(_PAGE, table(runs))
    print(f"{_PAGE} and its picture are written")


if __name__ == "__main__":
    sys.exit(run_command("curves", main))
