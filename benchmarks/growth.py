"""Build generated mines of 1 to 100 km of drifts and measure how time, memory and the environment's speed grow."""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import platform
import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from benchmarks import stage_costs
from pipeline.store.files import write_atomically

RESULTS, PAGE = Path("artifacts/bench/growth.jsonl"), Path("docs/growth.md")
SIZES_KM = (1, 3, 10, 30, 100)
_SIDE_M = 145.0  # of a mine with a kilometre of drifts; drifts grow with the area
_EXPONENT, _FROM_KM = 1.15, 3
_MOST_MB = 8192
_ENV_SHARE = 0.15
_ROUGH = "{rms_m: 0.06, hurst: 0.75, shortest_m: 0.3, longest_m: 6.0}"


@dataclass(frozen=True)
class Grown(stage_costs.Costs):
    """The figures of one mine."""

    km: float
    rock: bool
    drift_m: float
    loops: int
    parts: int
    bytes: int
    certificate: bool


def overrides(km: float, rock: bool) -> list[str]:
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
        *([] if rock else ["preset=light"]),
    ]


def measure(km: float, rock: bool) -> Grown:
    """Build one mine, each stage in a process of its own, and drive in it."""
    root = Path(tempfile.mkdtemp(prefix="growth-"))
    try:
        costs = stage_costs.measure(overrides(km, rock), root)
        network = json.loads((root / "contours/topology.json").read_text())
        metrics = json.loads((root / "validation/metrics.json").read_text())
        return Grown(
            km=km,
            rock=rock,
            drift_m=network["total_length_m"],
            loops=network["loops"],
            parts=metrics["collision"]["parts"],
            bytes=sum(f.stat().st_size for f in (root / "realism/world").rglob("*") if f.is_file()),
            certificate=metrics["certificate"]["holds"],
            **dataclasses.asdict(costs),
        )
    finally:
        shutil.rmtree(root, ignore_errors=True)


def exponent(rows: list[Grown]) -> float:
    """Return the exponent of processor time over drift, fitted from 3 km on."""
    some = [row for row in rows if row.km >= _FROM_KM]
    length, total = (np.log([f(row) for row in some]) for f in (lambda r: r.drift_m, total_s))
    return float(np.polyfit(length, total, 1)[0])


def total_s(row: Grown) -> float:
    """Return the processor seconds of all stages."""
    return sum(row.stages_s.values())


def page(rows: list[Grown]) -> str:
    """Return the page of the measured mines."""
    light = sorted((row for row in rows if not row.rock), key=lambda r: r.km)
    rocky = sorted((row for row in rows if row.rock), key=lambda r: r.km)
    lines = [
        "# Growth\n",
        f"Written by `make bench-growth` on {platform.machine()} with {os.cpu_count()} cores. Generated mines of "
        "narrow drifts (2.5 to 3.5 m) with rough\nwalls go through all six stages; each stage and the environment have "
        "a process of their own. Seconds are processor time.\nThe environment steps sixteen robots on one thread.\n",
        "## Collision world, certificate and environment\n",
        "Light worlds (`preset=light`): all stages without visible rock, the certificate without the stress test.\n",
        _table(light),
    ]
    if len([row for row in light if row.km >= _FROM_KM]) > 1:
        lines.append(
            f"From {light[0].km if light[0].km >= _FROM_KM else _FROM_KM:g} to {light[-1].km:g} km time grows as "
            f"length to the power of {exponent(light):.2f} (limit {_EXPONENT:g})."
        )
    if rocky:
        lines += ["\n## With visible rock\n", "All stages with the default rock, and all checks.\n", _table(rocky)]
    sizes = [km for km in SIZES_KM if km not in {row.km for row in light}]
    if sizes:
        lines.append(f"\nNot measured yet: {', '.join(f'{km} km' for km in sizes)}.")
    return "\n".join(lines) + "\n"


def _table(rows: list[Grown]) -> str:
    head = (
        "| drifts, km | loops | s | s per km | largest memory, MB | in stage | parts | per m | MB | certificate | "
        "env: made in s | MB | steps/s | reset, ms |\n" + "|---" * 14 + "|"
    )
    lines = [head]
    for row in rows:
        stage = max(row.peak_mb, key=lambda name: row.peak_mb[name])
        lines.append(
            f"| {row.drift_m / 1000:.2f} | {row.loops:,} | {total_s(row):,.1f} | "
            f"{1000 * total_s(row) / row.drift_m:.2f} | "
            f"{row.peak_mb[stage]:,.0f} | {stage} | {row.parts:,} | {row.parts / row.drift_m:.3f} | "
            f"{row.bytes / 1e6:,.2f} | {'holds' if row.certificate else 'fails'} | {row.load_s:.2f} | "
            f"{row.env_peak_mb:,.0f} | {row.steps_per_s:,.0f} | {row.reset_ms:.3f} |"
        )
    return "\n".join(lines) + "\n"


def faults(rows: list[Grown]) -> list[str]:
    """Return what misses a limit."""
    light = sorted((row for row in rows if not row.rock), key=lambda r: r.km)
    missed = [f"{row.km:g} km: the certificate does not hold" for row in rows if not row.certificate]
    missed += [f"{r.km:g} km: {m:.0f} MB in {s}" for r in light for s, m in r.peak_mb.items() if m > _MOST_MB]
    if len([row for row in light if row.km >= _FROM_KM]) > 1 and exponent(light) > _EXPONENT:
        missed.append(f"exponent {exponent(light):.2f}, limit {_EXPONENT:g}")
    if len(light) > 1 and light[-1].steps_per_s < (1 - _ENV_SHARE) * light[0].steps_per_s:
        missed.append(f"{light[-1].km:g} km: {light[-1].steps_per_s:.0f} steps/s of {light[0].steps_per_s:.0f}")
    if len(light) > 1 and light[-1].reset_ms > (1 + _ENV_SHARE) * light[0].reset_ms:
        missed.append(f"{light[-1].km:g} km: a reset takes {light[-1].reset_ms:.3f} ms of {light[0].reset_ms:.3f}")
    return missed


def main() -> int:
    """Measure the mines that have no result yet, and write the page; exit code 2 if a figure misses its limit."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.growth", description=__doc__)
    parser.add_argument("--km", type=float, nargs="+", default=SIZES_KM, help="drifts of the light mines, km")
    parser.add_argument("--rock", type=float, nargs="*", default=[1, 3], help="drifts of the mines with rock, km")
    given = parser.parse_args()
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    lines = RESULTS.read_text().splitlines() if RESULTS.is_file() else []
    rows = [Grown(**json.loads(line)) for line in lines]
    measured = {(row.km, row.rock) for row in rows}
    wanted = [(km, rock) for rock, sizes in ((False, given.km), (True, given.rock)) for km in sizes]
    with RESULTS.open("a") as log:
        for km, rock in tqdm([w for w in wanted if w not in measured], unit="mine", disable=None):
            rows.append(measure(km, rock))
            log.write(json.dumps(dataclasses.asdict(rows[-1])) + "\n")
            log.flush()
    write_atomically(PAGE, page(rows).encode())
    print(page(rows))
    for line in faults(rows):
        print(f"bench-growth: {line}", file=sys.stderr)
    return 2 if faults(rows) else 0


if __name__ == "__main__":
    sys.exit(main())
