"""Build mines of 1 to 10 km and measure how time, memory and the environment's speed grow.

Level mines are light (without visible rock), one has rock, and one is a volume. `--count 10` adds the
other styles and mines of 30 and 80 km.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.judged_cases import JudgedCases, largest
from benchmarks.results import Row
from benchmarks.speed import stage_costs
from minexplore.splits import STYLES
from pipeline.import_mine import draft_import, import_mine
from pipeline.params.stated import StatedOptions
from tests.project import Project

LONG, VOLUME = "drift_and_crosscut", "wheal_pell"  # the style of long mines, and a survey with heights
CASES = (
    *((LONG, "light", km) for km in (1, 3, 10)),
    (LONG, "rock", 1),
    (VOLUME, "light", 2),
    *((style, "light", 1) for style in STYLES if style != LONG),
    *((LONG, "light", km) for km in (30, 80)),
)
_SIDE_M = 145.0  # of a mine with a kilometre of drifts; drifts grow with the area
_PELL = Path("data/wheal_pell/pell.3d")
_EXPONENT, _FROM_KM = 1.15, 2.5  # of time over length; the mine of 3 km has 2.86 km
_MOST_MB = 8192
_ROUGH = "{rms_m: 0.06, hurst: 0.75, shortest_m: 0.3, longest_m: 6.0}"


def overrides(style: str, kind: str, km: float) -> list[str]:
    """Return the settings of a level mine with about this length of narrow, rough drifts."""
    side = _SIDE_M * km**0.5
    return [
        "survey=procedural",
        "survey.seed=1",
        f"survey.mine.style={style}",
        f"survey.mine.size_m=[{side - 5:.1f},{side + 5:.1f}]",
        "survey.mine.width_m=[2.5,3.5]",
        "survey.mine.loops=0.02",
        "survey.mine.dead_ends=0.6",
        "survey.mine.spacing_m=30",
        f"survey.rough_walls={_ROUGH}",
        *([] if kind == "rock" else ["preset=light"]),
    ]


def measure(case: tuple[str, str, float]) -> Row:
    """Build one mine, each stage in a process of its own, and drive in it."""
    style, kind, km = case
    with tempfile.TemporaryDirectory(prefix="growth-") as name:
        root = Path(name)
        if style == VOLUME:
            costs, root = measure_file(_PELL, Project(root / "project", tiny=False))
        else:
            costs = stage_costs.measure(overrides(style, kind, km), root)
        return row_of(root) | dataclasses.asdict(costs)


def measure_file(file: Path, project: Project) -> tuple[stage_costs.Costs, Path]:
    """Build a survey in a copy of the project, as `new --from FILE preset=light` does, and drive in it.

    Returns
    -------
    Costs
    Path
        The world's folder.

    Raises
    ------
    MineError, RuntimeError
        If the file is refused, or a stage fails.
    """
    name = file.stem
    with contextlib.chdir(project.folder):
        import_mine(draft_import(name, file, StatedOptions()), "a measurement", "CC0-1.0")
    root = Path("artifacts/worlds") / name
    return stage_costs.measure([f"survey={name}", "preset=light"], root, project.folder), project.folder / root


def row_of(root: Path) -> Row:
    """Return length, size and certificate of a world's folder."""
    metrics = json.loads((root / "validation/metrics.json").read_text())
    survey, network = metrics.get("survey", {}), json.loads((root / "contours/topology.json").read_text())
    parts = metrics.get("collision") or json.loads((root / "realism/world/world.json").read_text())["volume"]
    return {
        "drift_m": survey.get("length_m") or network["total_length_m"],
        "parts": parts["parts"],
        "bytes": sum(file.stat().st_size for file in (root / "realism/world").rglob("*") if file.is_file()),
        "certificate": bool(metrics["certificate"]["holds"]),
    }


def total_s(row: Row) -> float:
    """Return the processor seconds of all stages."""
    return float(sum(row["stages_s"].values()))


def exponent(rows: list[Row]) -> float | None:
    """Return the exponent of processor time over length of the light level mines beyond 2.5 km, if there are some."""
    long = [row for row in rows if tuple(row["case"][:2]) == (LONG, "light") and row["drift_m"] > 1000 * _FROM_KM]
    if len(long) < 2:
        return None
    length, seconds = np.log([(row["drift_m"], total_s(row)) for row in long]).T
    return float(np.polyfit(length, seconds, 1)[0])


def note(rows: list[Row]) -> str:
    """Return how time grows, against its limit."""
    found = exponent(rows)
    if found is None:
        return ""
    missed = "" if found <= _EXPONENT else ", **missed**"
    return f"From 3 km on time grows as length to the power of {found:.2f} (limit {_EXPONENT:g}{missed}).\n"


def holds(row: Row) -> bool:
    """Return whether a mine's certificate holds and no stage takes more than 8 GB."""
    return row["certificate"] and max(row["peak_mb"].values()) <= _MOST_MB


def _stage_of_peak(rows: list[Row]) -> str:
    peaks = rows[0]["peak_mb"]
    return max(peaks, key=lambda name: peaks[name])


GROWTH = JudgedCases(
    name="growth",
    cases=CASES,
    sample=5,
    judge=measure,
    holds=holds,
    groups=lambda row: ["{}, {}, {} km".format(*row["case"]).replace("_", " ")],
    of="mine",
    with_all=False,
    columns={
        "drifts, km": largest("drift_m", ".2f", 1e-3),
        "s": lambda rows: f"{total_s(rows[0]):,.1f}",
        "s per km": lambda rows: f"{1000 * total_s(rows[0]) / rows[0]['drift_m']:.2f}",
        "largest memory, MB": lambda rows: f"{max(rows[0]['peak_mb'].values()):,.0f}",
        "in stage": _stage_of_peak,
        "parts": largest("parts", ",.0f"),
        "MB": largest("bytes", ",.2f", 1e-6),
        "certificate": lambda rows: "holds" if rows[0]["certificate"] else "**broken**",
        "env: made in s": largest("load_s", ".2f"),
        "env: MB": largest("env_peak_mb", ",.0f"),
        "steps/s": largest("steps_per_s", ",.0f"),
        "reset, ms": largest("reset_ms", ".3f"),
    },
    note=note,
)

if __name__ == "__main__":
    sys.exit(GROWTH.run(__doc__))
