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
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from benchmarks.speed.stage_costs import STAGES, Costs, measure
from benchmarks.worlds.deep_mine import HALF_M, deep_mine
from minexplore.floors.floor import Floor
from pipeline.import_mine import import_mine
from pipeline.params.stated import StatedOptions
from pipeline.store.codecs import decode
from pipeline.store.files import write_atomically
from tests.heights import table
from tests.project import Project

RESULTS, PAGE = Path("artifacts/bench/deep.jsonl"), Path("docs/evidence/parts/deep-mines.md")
_SIZES_KM, _LEVELS, _SEED = (40.0, 80.0), 20, 1
_HEAD = """# Deep mines

Written by `python -m benchmarks bench-deep` on {machine} with {cores} cores. Surveys of
`benchmarks/worlds/deep_mine.py`, whose levels are
50 m apart and joined by a decline, go through all six stages as light worlds (`preset=light`): the certificate is
whole but for the stress test. Each stage and the environment have a process of their own. Seconds are processor time,
with that of the child that reads the survey; memory is the largest of one process. The environment steps sixteen
robots on one thread.

| asked, km | levels | drifts, km | depth, m | sheets | prisms | s | s per km | GB, at most | in stage | certificate |
|---|---|---|---|---|---|---|---|---|---|---|
"""
_ENVIRONMENT = """
## Environment

| drifts, km | made in s | memory, MB | control steps/s | reset, ms |
|---|---|---|---|---|
"""


@dataclass(frozen=True)
class Deep:
    """The figures of one mine; lengths are of drifts, `km` as asked for and `drift_m` as built."""

    km: float
    levels: int
    drift_m: float
    depth_m: float
    sheets: int
    parts: int
    certificate: bool
    costs: Costs

    @classmethod
    def of(cls, line: str) -> Deep:
        """Return the figures in a line of the results' file."""
        values = json.loads(line)
        return cls(**{**values, "costs": Costs(**values["costs"])})

    @property
    def total_s(self) -> float:
        """Return the processor seconds of all stages."""
        return sum(self.costs.stages_s.values())


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
    with contextlib.chdir(project.folder):
        Path(f"{name}.csv").write_text(text)
        import_mine(name, Path(f"{name}.csv"), "generated", "CC0-1.0", StatedOptions())
    root = Path("artifacts/worlds") / name
    costs = measure([f"survey={name}", "preset=light"], root, project.folder)
    built = project.folder / root
    floor = decode(built / "compile3d/floor.npz", Floor)
    metrics = json.loads((built / "validation/metrics.json").read_text())
    return Deep(
        km=km,
        levels=levels,
        drift_m=json.loads((built / "contours/topology.json").read_text())["total_length_m"],
        depth_m=round(float(np.ptp(floor.vertices[:, 2])), 1),
        sheets=len(floor.offset_m),
        parts=metrics["collision"]["parts"],
        certificate=metrics["certificate"]["holds"],
        costs=costs,
    )


def page(rows: list[Deep]) -> str:
    """Return docs/evidence/parts/deep-mines.md."""
    rows = sorted(rows, key=lambda row: (row.drift_m, row.levels))
    lines = [_HEAD.format(machine=platform.machine(), cores=os.cpu_count())]
    for row in rows:
        memory = row.costs.peak_mb
        worst = max(memory, key=lambda name: memory[name])
        cells: list[object] = [
            f"{row.km:g}",
            row.levels,
            f"{row.drift_m / 1000:.1f}",
            f"{row.depth_m:,.0f}",
            row.sheets,
            f"{row.parts:,}",
            f"{row.total_s:,.0f}",
            f"{1000 * row.total_s / row.drift_m:.1f}",
            f"{memory[worst] / 1000:.1f}",
            worst,
            "holds" if row.certificate else "**broken**",
        ]
        lines.append(f"| {' | '.join(map(str, cells))} |\n")
    for title, unit, figures, form in (
        ("Processor time a stage", "s", [row.costs.stages_s for row in rows], ".1f"),
        ("Largest memory a stage", "GB", [_gigabytes(row.costs.peak_mb) for row in rows], ".2f"),
    ):
        lines.append(f"\n## {title}\n\n| drifts, km | {' | '.join(f'{name}, {unit}' for name in STAGES)} |\n")
        lines.append("|---" * (1 + len(STAGES)) + "|\n")
        for row, of_stage in zip(rows, figures, strict=True):
            of_stages = " | ".join(format(of_stage[name], form) for name in STAGES)
            lines.append(f"| {row.drift_m / 1000:.1f} | {of_stages} |\n")
    lines.append(_ENVIRONMENT)
    for row in rows:
        costs = row.costs
        lines.append(
            f"| {row.drift_m / 1000:.1f} | {costs.load_s:.1f} | {costs.env_peak_mb:,.0f} | {costs.steps_per_s:,.0f} "
            f"| {costs.reset_ms:.3f} |\n"
        )
    return "".join(lines)


def _gigabytes(megabytes: dict[str, float]) -> dict[str, float]:
    return {name: value / 1000 for name, value in megabytes.items()}


def main() -> int:
    """Measure the mines that have no result yet, and write the page; exit code 2 if a certificate does not hold."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed.time_deep", description=__doc__)
    parser.add_argument("--km", type=float, nargs="+", default=_SIZES_KM, help="drifts of the mines, km")
    parser.add_argument("--levels", type=int, default=_LEVELS)
    given = parser.parse_args()
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    rows = [Deep.of(line) for line in RESULTS.read_text().splitlines()] if RESULTS.is_file() else []
    measured = {(row.km, row.levels) for row in rows}
    wanted = [km for km in given.km if (km, given.levels) not in measured]
    with RESULTS.open("a") as log, tempfile.TemporaryDirectory(prefix="deep-") as folder:
        project = Project(Path(folder), tiny=False)  # one for all: the code stays as it is while they are built
        for k, km in enumerate(tqdm(wanted, unit="mine", disable=None)):
            text = table(deep_mine(given.levels, 1000 * km, _SEED), HALF_M)
            rows.append(measure_survey(project, f"deep-{k}", text, km, given.levels))
            log.write(json.dumps(dataclasses.asdict(rows[-1])) + "\n")
            log.flush()
    write_atomically(PAGE, page(rows).encode())
    print(page(rows))
    broken = [row for row in rows if not row.certificate]
    for row in broken:
        print(f"bench-deep: {row.km:g} km on {row.levels} levels: the certificate does not hold", file=sys.stderr)
    return 2 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
