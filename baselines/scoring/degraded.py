"""Coverage of explorers with degraded sensors or counted poses: the file that keeps it, and the table of losses."""

from __future__ import annotations

import json
from pathlib import Path

from pydantic import BaseModel, ConfigDict, TypeAdapter

from baselines.base.markdown import markdown_table
from baselines.base.refusals import read_kept
from baselines.base.result_file import RESULTS, replace_text
from baselines.explorers import EXPLORERS

DEGRADED = RESULTS / "degraded.json"
TRUE = "ideal"  # senses that are not degraded
DRIVEN = tuple(name for name in EXPLORERS if name != "random")  # a random walk takes no notice of its senses


class Drives(BaseModel):
    """Means of some episodes: coverage, collisions, and how far the known pose is off at the end, m."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    inputs_sha256: str  # of the world, the task, the senses and the code of the policy
    episodes: int
    coverage: float
    collisions: float
    off_m: float


Senses = dict[str, Drives]  # by the name of the senses
_KEPT = TypeAdapter(dict[str, dict[str, Senses]])  # by environment and policy


def read_degraded(path: Path | None = None) -> dict[str, dict[str, Senses]]:
    """Return what is kept by environment, policy and senses; nothing without the file.

    Raises
    ------
    BaselineError
        If the file cannot be read, or holds something else.
    """
    return read_kept(path or DEGRADED, _KEPT, {}, "drives by worse senses")


def keep_drives(env_id: str, policy: str, senses: str, drives: Drives, path: Path | None = None) -> None:
    """Add what a policy's episodes came to to the file."""
    kept = read_degraded(path)
    kept.setdefault(env_id, {}).setdefault(policy, {})[senses] = drives
    replace_text(path or DEGRADED, json.dumps(_KEPT.dump_python(kept), indent=1) + "\n")


def degraded_table(rows: dict[str, Senses]) -> str:
    """Return a table of one environment: each policy's coverage by ideal senses, and the points that others cost.

    A line under it names the explorers that are not driven by all senses.
    """
    names = [name for name in next(iter(rows.values())) if name != TRUE]
    columns = ["policy", "episodes", "coverage", *(f"lost, {name}" for name in names)]
    columns += ["pose off at the end by odometry, m"] if "odometry" in names else []
    cells = []
    best_first = sorted(rows.items(), key=lambda item: -item[1][TRUE].coverage if TRUE in item[1] else 0.0)
    for policy, senses in best_first:
        if {TRUE, *names} - senses.keys():
            continue  # not all are driven yet
        ideal = senses[TRUE]
        lost = [f"{100 * (ideal.coverage - senses[name].coverage):.1f}" for name in names]
        off = [f"{senses['odometry'].off_m:.1f}"] if "odometry" in names else []
        cells.append([policy, ideal.episodes, f"{100 * ideal.coverage:.1f} %", *lost, *off])
    measured = {policy for policy, *_ in cells}
    left = [name for name in DRIVEN if name not in measured]
    return markdown_table(columns, cells) + (f"\nNot measured: {', '.join(left)}.\n" if left else "")
