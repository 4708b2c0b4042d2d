"""Build deep mines of many levels and measure each stage and the environment: `python -m benchmarks bench-deep`."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import os
import platform
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from baselines.base.markdown import markdown_table, write_table
from benchmarks.resume import resume
from benchmarks.speed.stage_costs import STAGES, Costs, measure
from benchmarks.worlds.deep_mine import HALF_M, deep_mine
from minexplore.bundle import RECORD, TOPOLOGY
from pipeline.import_mine import draft_import, import_mine
from pipeline.params.stated import StatedOptions
from tests.heights import table
from tests.project import Project

RESULTS, PAGE = Path("artifacts/bench/deep.jsonl"), Path("docs/evidence/parts/deep-mines.md")
_SIZES_KM, _LEVELS, _SEED = (40.0, 80.0), 20, 1
_COLUMNS = (
    *("asked, km", "levels", "drifts, km", "depth, m", "storeys", "parts", "s", "s per km", "GB, at most"),
    *("in stage", "certificate"),
)
_DRIVEN = ("drifts, km", "made in s", "memory, MB", "control steps/s", "reset, ms")


@dataclass(frozen=True)
class Deep:
    """The figures of one mine; lengths are of drifts, `km` as asked for and `drift_m` as built."""

    km: float
    levels: int
    drift_m: float
    depth_m: float
    storeys: int
    parts: int
    certificate: bool
    costs: Costs

    @classmethod
    def of(cls, row: dict[str, Any]) -> Deep:
        """Return the figures in a row of the results' file."""
        return cls(**{**row, "costs": Costs(**row["costs"])})

    @property
    def total_s(self) -> float:
        """Return the processor seconds of all stages."""
        return sum(self.costs.stages_s.values())


def measure_file(file: str, text: str, stated: StatedOptions, project: Project) -> tuple[Costs, Path]:
    """Build a mine's file in a copy of the project, as `new ... preset=light` does, and drive in it.

    Parameters
    ----------
    file : str
        The file's name; that of the world is its stem.
    text : str
        Its content.
    stated : StatedOptions
        What the options of `new` state.
    project : Project

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
    name = Path(file).stem
    with contextlib.chdir(project.folder):
        Path(file).write_text(text)
        import_mine(draft_import(name, Path(file), stated), "generated", "CC0-1.0")
    root = Path("artifacts/worlds") / name
    return measure([f"survey={name}", "preset=light"], root, project.folder), project.folder / root


def measure_survey(project: Project, name: str, text: str, km: float, levels: int) -> Deep:
    """Build a station table in a copy of the project, as `new` does, and measure it.

    Parameters
    ----------
    project : Project
    name : str
        Of the world.
    text : str
        The table.
    km, levels : float, int
        What was asked for.

    Raises
    ------
    MineError, RuntimeError
        If the table is refused, or a stage fails.
    """
    costs, built = measure_file(f"{name}.csv", text, StatedOptions(), project)
    metrics = json.loads((built / "validation/metrics.json").read_text())
    stations = json.loads((built / "realism/world" / TOPOLOGY).read_text())["stations_m"]
    figures = json.loads((built / "realism/world" / RECORD).read_text())["volume"]
    return Deep(
        km=km,
        levels=levels,
        drift_m=metrics["survey"]["length_m"],
        depth_m=round(float(np.ptp([z for *_, z in stations.values()])), 1),
        storeys=figures["storeys"],
        parts=figures["parts"],
        certificate=metrics["certificate"]["holds"],
        costs=costs,
    )


def tables(rows: list[Deep]) -> str:
    """Return the tables of docs/evidence/parts/deep-mines.md."""
    rows = sorted(rows, key=lambda row: (row.drift_m, row.levels))
    km = [f"{row.drift_m / 1000:.1f}" for row in rows]
    costs = [row.costs for row in rows]
    times = [[f"{c.stages_s[name]:.1f}" for name in STAGES] for c in costs]
    memory = [[f"{c.peak_mb[name] / 1000:.2f}" for name in STAGES] for c in costs]
    driven = [(f"{c.load_s:.1f}", f"{c.env_peak_mb:,.0f}", f"{c.steps_per_s:,.0f}", f"{c.reset_ms:.3f}") for c in costs]
    sections = (
        ("Processor time a stage", ["drifts, km", *(f"{name}, s" for name in STAGES)], times),
        ("Largest memory a stage", ["drifts, km", *(f"{name}, GB" for name in STAGES)], memory),
        ("Environment", _DRIVEN, driven),
    )
    measured = f"Measured on {platform.machine()} with {os.cpu_count()} cores.\n\n"
    text = measured + markdown_table(_COLUMNS, map(_cells, rows))
    for title, columns, cells in sections:
        text += f"\n## {title}\n\n" + markdown_table(columns, ([a, *b] for a, b in zip(km, cells, strict=True)))
    return text


def _cells(row: Deep) -> list[object]:
    memory = row.costs.peak_mb
    worst = max(memory, key=lambda name: memory[name])
    return [
        f"{row.km:g}",
        row.levels,
        f"{row.drift_m / 1000:.1f}",
        f"{row.depth_m:,.0f}",
        row.storeys,
        f"{row.parts:,}",
        f"{row.total_s:,.0f}",
        f"{1000 * row.total_s / row.drift_m:.1f}",
        f"{memory[worst] / 1000:.1f}",
        worst,
        "holds" if row.certificate else "**broken**",
    ]


def _measured(sizes: list[tuple[float, int]]) -> Iterator[dict[str, Any]]:
    """Build mines of so many kilometres and levels, and yield their figures."""
    with tempfile.TemporaryDirectory(prefix="deep-") as folder:
        project = Project(Path(folder), tiny=False)  # one for all: the code stays as it is while they are built
        for k, (km, levels) in enumerate(sizes):
            text = table(deep_mine(levels, 1000 * km, _SEED), HALF_M)
            yield dataclasses.asdict(measure_survey(project, f"deep-{k}", text, km, levels))


def main() -> int:
    """Measure the mines that have no result yet, and write the page; exit code 2 if a certificate does not hold."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed.time_deep", description=__doc__)
    parser.add_argument("--km", type=float, nargs="+", default=_SIZES_KM, help="drifts of the mines, km")
    parser.add_argument("--levels", type=int, default=_LEVELS)
    given = parser.parse_args()
    wanted = [(km, given.levels) for km in given.km]
    rows = [Deep.of(row) for row in resume(RESULTS, wanted, _measured, "mine", lambda row: (row["km"], row["levels"]))]
    write_table(PAGE, tables(rows))
    print(tables(rows))
    broken = [row for row in rows if not row.certificate]
    for row in broken:
        print(f"bench-deep: {row.km:g} km on {row.levels} levels: the certificate does not hold", file=sys.stderr)
    return 2 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
