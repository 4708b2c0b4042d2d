"""Training of the graph explorer as pictures and tables of a page; see `baselines.ppo.curves`."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from pydantic import ValidationError

from baselines.base.errors import BaselineError
from baselines.base.markdown import markdown_table
from baselines.graph.training.settings import GraphSettings

matplotlib.use("Agg")
import matplotlib.pyplot as plt

RUNS = Path("artifacts/train")
KEPT = Path("baselines/results/graph_training")
_PICTURE = Path("docs/graph-training.png")
_WHOLE = "graph"  # the name of the runs that lack nothing
_LACKS = {"attention": "clusters are scored alone", "stubs": "no figures of dead ends", "floor": "no figures of floors"}


@dataclass(frozen=True)
class Curve:
    """One run: what is seen of each watched mine, and what the nearest cluster sees there.

    Attributes
    ----------
    updates
        When the network drove there.
    by_mine
        Shares, (update, mine).
    """

    settings: GraphSettings
    updates: list[int]
    by_mine: np.ndarray
    nearest: float

    @property
    def watched(self) -> np.ndarray:
        """Return the mean over the mines, (update,)."""
        return self.by_mine.mean(axis=1)

    def at(self, update: int) -> np.ndarray:
        """Return the share of each mine at an update, (mine,)."""
        return self.by_mine[self.updates.index(update)]

    @property
    def best(self) -> int:
        """Return the index of the update whose network saw most."""
        return int(np.argmax(self.watched))


def keep(runs: Path = RUNS, kept: Path = KEPT) -> None:
    """Write what the page needs of all runs to files that git tracks."""
    for file in sorted(runs.glob("*/progress.jsonl")):
        try:
            settings = GraphSettings.model_validate_json((file.parent / "settings.json").read_bytes())
        except (OSError, ValidationError):
            continue  # a run of PPO
        lines = [json.loads(line) for line in file.read_text().splitlines()]
        watched = [line for line in lines if line.get("watched")]
        if watched:
            kept.mkdir(parents=True, exist_ok=True)
            record = {"settings": settings.model_dump(mode="json"), "watched": watched}
            (kept / f"{settings.label}.json").write_text(json.dumps(record) + "\n")


def read_curves(kept: Path = KEPT) -> list[Curve]:
    """Return the kept runs, sorted by name and seed.

    Raises
    ------
    BaselineError
        If there is none.
    """
    curves = []
    for file in kept.glob("*.json"):
        record = json.loads(file.read_text())
        lines = {line["update"]: line for line in record["watched"]}
        nearest = float(np.mean(lines[0]["nearest"]))
        by_mine = np.array([lines[update]["watched"] for update in sorted(lines)])
        curves.append(Curve(GraphSettings.model_validate(record["settings"]), sorted(lines), by_mine, nearest))
    if not curves:
        raise BaselineError(f"{kept}: no runs; `python -m benchmarks train-graph seed=42` makes one")
    return sorted(curves, key=lambda curve: (curve.settings.name, curve.settings.seed))


def draw_curves(curves: list[Curve], path: Path) -> None:
    """Draw the watched shares of each name: mean over seeds, and the range from the least to the greatest."""
    figure, axis = plt.subplots(figsize=(8, 4.2), layout="constrained")
    names = dict.fromkeys(curve.settings.name for curve in curves)
    for number, name in enumerate(names):
        colour = f"C{number}"  # of matplotlib's cycle
        group = [curve for curve in curves if curve.settings.name == name]
        at = sorted(set.intersection(*(set(curve.updates) for curve in group)))
        shares = 100 * np.array([[c.watched[c.updates.index(update)] for update in at] for c in group])
        axis.plot(at, shares.mean(axis=0), color=colour, label=f"{name}, {len(group)} seed{'s' * (len(group) > 1)}")
        axis.fill_between(at, shares.min(axis=0), shares.max(axis=0), color=colour, alpha=0.2, lw=0)
    nearest = 100 * float(np.mean([curve.nearest for curve in curves]))
    axis.axhline(nearest, color="#222222", ls=":", lw=1, label="nearest cluster")
    axis.set(xlabel="updates", ylabel="share of the watched mines, %")
    axis.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def tables(curves: list[Curve]) -> str:
    """Return the table of runs and that of ablations."""
    rows: list[tuple[object, ...]] = []
    for curve in curves:
        shares = [f"{100 * share:.1f}" for share in (curve.watched[0], curve.watched[curve.best], curve.nearest)]
        run = (curve.settings.name, curve.settings.seed, curve.updates[-1])
        rows.append((*run, *shares[:2], curve.updates[curve.best], shares[2]))
    for name in dict.fromkeys(curve.settings.name for curve in curves):
        group = 100 * np.array([max(curve.watched) for curve in curves if curve.settings.name == name])
        if len(group) > 1:
            spread = f"{group.mean():.1f}, SD {group.std(ddof=1):.1f}"
            rows.append((name, f"mean of {len(group)} seeds", "", "", spread, "", ""))
    runs = ("run", "seed", "updates", "watched at 0", "watched, best", "at update", "nearest cluster there")
    lacks = ("run", "seed", "part left out", "rule", "network", "at update")
    return f"{markdown_table(runs, rows)}\n## Ablations\n\n{markdown_table(lacks, _ablations(curves))}"


def _ablations(curves: list[Curve]) -> Iterator[tuple[object, ...]]:
    """Yield a row for each run that lacks a part, beside the whole network of its seed."""
    whole = {curve.settings.seed: curve for curve in curves if curve.settings.name == _WHOLE}
    for curve in curves:
        settings, other = curve.settings, whole.get(curve.settings.seed)
        lacks = [lack for part, lack in _LACKS.items() if not getattr(settings.network, part)]
        if not lacks or other is None or curve.by_mine.shape[1] != other.by_mine.shape[1]:
            continue
        last = max(set(curve.updates) & set(other.updates))
        rule, network = (_paired(100 * (curve.at(update) - other.at(update))) for update in (0, last))
        yield settings.name, settings.seed, ", ".join(lacks), rule, network, last


def _paired(differences: np.ndarray) -> str:
    return f"{differences.mean():+.1f} ± {differences.std(ddof=1) / np.sqrt(len(differences)):.1f}"


def drawn_tables() -> str:
    """Keep what the page needs, draw the picture, and return the tables."""
    keep()
    curves = read_curves()
    draw_curves(curves, _PICTURE)
    return tables(curves)
