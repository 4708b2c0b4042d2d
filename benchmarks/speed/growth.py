"""Build generated mines of 1 to 100 km of drifts and measure how time, memory and the environment's speed grow.

A mine is of a kind: `light`, with `rock`, or `coal`, whose roadways are spread over many times their area.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import platform
import re
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from baselines.base.markdown import write_table
from benchmarks.resume import resume
from benchmarks.speed import stage_costs
from benchmarks.speed.time_deep import measure_file
from benchmarks.worlds.coal_mine import HALF_M, coal_mine, geojson
from pipeline.params.stated import StatedOptions
from tests.project import Project

RESULTS, PAGE = Path("artifacts/bench/growth.jsonl"), Path("docs/evidence/parts/growth.md")
SIZES_KM, COAL_KM = (1, 3, 10, 30, 100), 218
_SIDE_M = 145.0  # of a mine with a kilometre of drifts; drifts grow with the area
_EXPONENT, _FROM_KM = 1.15, 3
_FROM_DRIFTS_KM = 2.5  # the drifts of the mine of 3 km are 2.86 km long
_HEADINGS = {
    "light": "## Collision world, certificate and environment",
    "rock": "## With visible rock",
    "coal": "## A coal mine drawn as lines",
}
_MOST_MB, _MOST_COAL_S = 8192, 600
_ENV_SHARE = 0.15
_ROUGH = "{rms_m: 0.06, hurst: 0.75, shortest_m: 0.3, longest_m: 6.0}"


@dataclass(frozen=True)
class Grown(stage_costs.Costs):
    """The figures of one mine."""

    km: float
    kind: str
    drift_m: float
    loops: int
    parts: int
    bytes: int
    certificate: bool


def overrides(km: float, kind: str) -> list[str]:
    """Return the settings of a mine with about this length of narrow, rough drifts."""
    side = _SIDE_M * km**0.5
    return [
        "survey=procedural",
        "survey.seed=1",
        "survey.mine.style=drift_and_crosscut",
        f"survey.mine.size_m=[{side - 5:.1f},{side + 5:.1f}]",
        "survey.mine.width_m=[2.5,3.5]",
        "survey.mine.loops=0.02",
        "survey.mine.dead_ends=0.6",
        "survey.mine.spacing_m=30",
        f"survey.rough_walls={_ROUGH}",
        *([] if kind == "rock" else ["preset=light"]),
    ]


def measure(km: float, kind: str) -> Grown:
    """Build one mine, each stage in a process of its own, and drive in it."""
    with tempfile.TemporaryDirectory(prefix="growth-") as folder:
        if kind == "coal":
            text = geojson(coal_mine(1000 * km))
            stated = StatedOptions(unit="m", half_width_m=HALF_M)
            costs, root = measure_file("coal.geojson", text, stated, Project(Path(folder) / "project", tiny=False))
        else:
            root = Path(folder)
            costs = stage_costs.measure(overrides(km, kind), root)
        network = json.loads((root / "contours/topology.json").read_text())
        metrics = json.loads((root / "validation/metrics.json").read_text())
        return Grown(
            km=km,
            kind=kind,
            drift_m=network["total_length_m"],
            loops=network["loops"],
            parts=metrics["collision"]["parts"],
            bytes=sum(f.stat().st_size for f in (root / "realism/world").rglob("*") if f.is_file()),
            certificate=metrics["certificate"]["holds"],
            **dataclasses.asdict(costs),
        )


def exponent(points: Iterable[tuple[float, float]]) -> float:
    """Return the exponent of processor time over drift, fitted to (km, s) of mines of about 3 km and more."""
    length, total = np.log([point for point in points if point[0] >= _FROM_DRIFTS_KM]).T
    return float(np.polyfit(length, total, 1)[0])


def points_of(rows: list[Grown]) -> list[tuple[float, float]]:
    """Return length, km, and processor time, s, of mines."""
    return [(row.drift_m / 1000, total_s(row)) for row in rows]


def total_s(row: Grown) -> float:
    """Return the processor seconds of all stages."""
    return sum(row.stages_s.values())


def tables(rows: list[Grown], before: str = "") -> str:
    """Return the tables of the measured mines; mines that only the page `before` has keep their rows.

    The page is the only record of a long measurement that another clone has.
    """
    lines_of = {kind: _lines_of([row for row in rows if row.kind == kind], before, kind) for kind in _HEADINGS}
    lines = [f"Measured on {platform.machine()} with {os.cpu_count()} cores.\n"]
    points = [(_cell(line, 0), _cell(line, 2)) for line in lines_of["light"]]
    sizes = sorted(_size_of(km) for km, _ in points)
    for kind, found in lines_of.items():
        lines += [f"{_HEADINGS[kind]}\n", _table(found)] if found or kind == "light" else []
        if kind == "light" and sum(km >= _FROM_DRIFTS_KM for km, _ in points) > 1:
            lines.append(
                f"From {max(sizes[0], _FROM_KM):g} to {sizes[-1]:g} km time grows as "
                f"length to the power of {exponent(points):.2f} (limit {_EXPONENT:g}).\n"
            )
    missing = [km for km in SIZES_KM if km not in sizes]
    if missing:
        lines.append(f"Not measured yet: {', '.join(f'{km} km' for km in missing)}.")
    return "\n".join(lines)


def _size_of(drift_km: float) -> float:
    """Return the size that a mine was made for: its drifts are 0.8 to 1.15 times as long."""
    return min(SIZES_KM, key=lambda km: abs(np.log(drift_km / km)))


def _lines_of(rows: list[Grown], before: str, kind: str) -> list[str]:
    """Return the lines of a section's table, the shortest mine first; a mine measured again replaces its line."""
    section = before.partition(_HEADINGS[kind])[2].partition("\n## ")[0]
    kept = [line for line in section.splitlines() if re.match(r"\| \d", line)]
    lines = {_cell(line, 0): line for line in [*kept, *map(_line, rows)]}
    return [lines[km] for km in sorted(lines)]


def _cell(line: str, column: int) -> float:
    return float(line.split(" | ")[column].lstrip("| ").replace(",", ""))


def _table(lines: list[str]) -> str:
    head = (
        "| drifts, km | loops | s | s per km | largest memory, MB | in stage | parts | per m | MB | certificate | "
        "env: made in s | MB | steps/s | reset, ms |\n" + "|---" * 14 + "|"
    )
    return "\n".join([head, *lines]) + "\n"


def _line(row: Grown) -> str:
    stage = max(row.peak_mb, key=lambda name: row.peak_mb[name])
    return (
        f"| {row.drift_m / 1000:.2f} | {row.loops:,} | {total_s(row):,.1f} | "
        f"{1000 * total_s(row) / row.drift_m:.2f} | "
        f"{row.peak_mb[stage]:,.0f} | {stage} | {row.parts:,} | {row.parts / row.drift_m:.3f} | "
        f"{row.bytes / 1e6:,.2f} | {'holds' if row.certificate else 'fails'} | {row.load_s:.2f} | "
        f"{row.env_peak_mb:,.0f} | {row.steps_per_s:,.0f} | {row.reset_ms:.3f} |"
    )


def faults(rows: list[Grown]) -> list[str]:
    """Return what misses a limit."""
    light, coal = ([row for row in rows if row.kind == kind] for kind in ("light", "coal"))
    light.sort(key=lambda r: r.km)
    missed = [f"{row.km:g} km: the certificate does not hold" for row in rows if not row.certificate]
    missed += [f"{r.km:g} km: {m:.0f} MB in {s}" for r in light + coal for s, m in r.peak_mb.items() if m > _MOST_MB]
    missed += [f"{r.km:g} km: {total_s(r):.0f} s, limit {_MOST_COAL_S}" for r in coal if total_s(r) > _MOST_COAL_S]
    points = points_of(light)
    if sum(km >= _FROM_DRIFTS_KM for km, _ in points) > 1 and exponent(points) > _EXPONENT:
        missed.append(f"exponent {exponent(points):.2f}, limit {_EXPONENT:g}")
    if len(light) > 1 and light[-1].steps_per_s < (1 - _ENV_SHARE) * light[0].steps_per_s:
        missed.append(f"{light[-1].km:g} km: {light[-1].steps_per_s:.0f} steps/s of {light[0].steps_per_s:.0f}")
    if len(light) > 1 and light[-1].reset_ms > (1 + _ENV_SHARE) * light[0].reset_ms:
        missed.append(f"{light[-1].km:g} km: a reset takes {light[-1].reset_ms:.3f} ms of {light[0].reset_ms:.3f}")
    return missed


def main() -> int:
    """Measure the mines that have no result yet, and write the page; exit code 2 if a figure misses its limit."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed.growth", description=__doc__)
    parser.add_argument("--km", type=float, nargs="*", default=SIZES_KM, help="drifts of the light mines, km")
    parser.add_argument("--rock", type=float, nargs="*", default=[1, 3], help="drifts of the mines with rock, km")
    parser.add_argument("--coal", type=float, nargs="*", default=[COAL_KM], help="roadways of coal mines, km")
    given = parser.parse_args()
    asked = {"light": given.km, "rock": given.rock, "coal": given.coal}
    wanted = [(km, kind) for kind, sizes in asked.items() for km in sizes]
    found = resume(
        RESULTS,
        wanted,
        lambda sizes: (dataclasses.asdict(measure(*size)) for size in sizes),
        "mine",
        key=lambda row: (row["km"], row["kind"]),
    )
    rows = [Grown(**row) for row in found]
    text = tables(rows, PAGE.read_text() if PAGE.is_file() else "")
    write_table(PAGE, text)
    print(text)
    for line in faults(rows):
        print(f"bench-growth: {line}", file=sys.stderr)
    return 2 if faults(rows) else 0


if __name__ == "__main__":
    sys.exit(main())
