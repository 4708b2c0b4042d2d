"""Seconds and memory of large volumes without rock, by step. A run goes on where the last one stopped.

`python -m benchmarks volume-large` measures what of Sakany's cave is within some distances of its middle, and mines of
some levels; `--deep KM` measures another mine. The steps are the floors, with the union of all legs, the parts and the
certificate's planes and booleans. Each survey is measured in a process of its own, which is set up as a stage is.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from baselines.base.markdown import markdown_table
from benchmarks.comparisons.volume.cases import CASES, GateCase
from benchmarks.resume import Row, resume, run_benchmark
from benchmarks.worlds.deep_mine import HALF_M, deep_mine
from pipeline.memory import keep_memory
from pipeline.volume.enclosure import measure_enclosure
from pipeline.volume.floors import solve_floors
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.shell import build_shell
from tests.heights import table

RESULTS = Path("artifacts/bench/volume-large.jsonl")
STEPS = ("floors", "shell", "certificate")
_WITHIN_M = (40.0, 80.0, 200.0, 1000.0)  # of Sakany's middle; the last is all of it
_DEEP_KM = (5.0, 10.0, 20.0)
_LEVEL_KM = 4.0  # of a mine on 20 levels of 80 km


def network_of_size(kind: str, size: float, folder: Path) -> SurveyNetwork:
    """Return the network of a `cave`, within a distance, m, of its middle, or of a `mine` of a length, km."""
    if kind == "cave":
        return CASES["sakany"].network(folder).within(size)
    legs = deep_mine(max(1, round(size / _LEVEL_KM)), 1000 * size, 1)
    return GateCase("deep mine", table(legs, HALF_M)).network(folder)


def measure(name: str) -> Row:
    """Build a survey as one volume, and return the processor seconds of each step and the peak of memory."""
    keep_memory()
    kind, size = name.split()
    with tempfile.TemporaryDirectory() as folder:
        network = network_of_size(kind, float(size), Path(folder))
    clock = [time.process_time()]
    volume = solve_floors(network)
    clock.append(time.process_time())
    parts = build_shell(volume)
    clock.append(time.process_time())
    found = measure_enclosure(volume, parts, 4, np.random.default_rng(0))
    clock.append(time.process_time())
    row: dict[str, Any] = {"name": name, "length_m": float(network.lengths_m.sum()), "legs": len(network.shots)}
    row |= {"facets": len(volume.faces), "parts": len(parts)}
    row |= {"intrusion_um": 1e6 * found.intrusion_m3 / found.measured_m2, "missing_m2": found.missing_m2}
    row |= dict(zip(STEPS, np.diff(clock).tolist(), strict=True))
    return row | {"peak_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20}


def _rows(names: list[str]) -> Iterable[Row]:
    for name in names:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as own:
            yield own.submit(partial(measure, name)).result()


def table_of(rows: list[Row]) -> str:
    """Return the rows as a table, the shortest first."""
    lines = []
    for row in sorted(rows, key=lambda row: (row["name"].split()[0], row["length_m"])):
        total = sum(row[step] for step in STEPS)
        size = (f"{row['length_m']:,.0f}", f"{row['facets']:,}", f"{row['parts']:,}")
        times = [f"{row[step]:.1f}" for step in STEPS]
        each = f"{1000 * total / row['length_m']:.1f}"
        lines.append((row["name"].split()[0], *size, *times, f"{total:.0f}", each, f"{row['peak_gb']:.1f}"))
    heads = ("m", "facets", "parts", *(f"{step}, s" for step in STEPS), "s in all", "ms a metre", "GB")
    return markdown_table(("survey", *heads), lines)


def main() -> int:
    """Measure what is missing; print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks volume-large", description=__doc__)
    parser.add_argument("--cave", type=float, nargs="*", default=_WITHIN_M, metavar="M", help="m from Sakany's middle")
    parser.add_argument("--deep", type=float, nargs="*", default=_DEEP_KM, metavar="KM", help="km of drifts")
    a = parser.parse_args()
    names = [f"cave {size:g}" for size in a.cave] + [f"mine {size:g}" for size in a.deep]
    rows = resume(RESULTS, names, _rows, "survey", key=lambda row: row["name"])
    print(table_of([row for row in rows if row["name"] in names]))
    return 0


if __name__ == "__main__":
    sys.exit(run_benchmark("volume-large", main))
