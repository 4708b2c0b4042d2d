"""Seconds and memory of large volumes without rock, by step. A run goes on where the last one stopped.

`python -m benchmarks volume-large` measures what of Sakany's cave is within some distances of its middle, and mines of
some levels; `--deep KM` measures another mine, `--caves KM` so many caves beside each other that they are so long. The
steps are the floors, with the union of all legs, the parts and the certificate's planes and booleans. Each survey is
measured in a new interpreter, which is set up as a stage is. Seconds are those of the clock; processor time is that of
all cores.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from baselines.base.markdown import markdown_table
from benchmarks.comparisons.volume.cases import CASES, GateCase, within
from benchmarks.resume import Row, resume, run_benchmark
from benchmarks.worlds.deep_mine import HALF_M, deep_mine
from pipeline.volume.enclosure import measure_enclosure
from pipeline.volume.floors import solve_floors
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.shell import build_shell
from tests.heights import table

RESULTS = Path("artifacts/bench/volume-large.jsonl")
STEPS = ("floors", "shell", "certificate")
_WITHIN_M = (40.0, 80.0, 200.0, 1000.0)  # of Sakany's middle; the last is all of it
_DEEP_KM = (5.0, 10.0, 20.0)
_APART_M = 20.0  # between the boxes of caves beside each other
_LEVEL_KM = 4.0  # of a mine on 20 levels of 80 km


def network_of_size(kind: str, size: float, folder: Path) -> SurveyNetwork:
    """Return a `cave` within a distance, m, of its middle, or `caves` beside each other or a `mine` of a length, km."""
    if kind == "cave":
        return within(CASES["sakany"].network(folder), size)
    if kind == "caves":
        return beside_itself(CASES["sakany"].network(folder), 1000 * size)
    legs = deep_mine(max(1, round(size / _LEVEL_KM)), 1000 * size, 1)
    return GateCase("deep mine", table(legs, HALF_M)).network(folder)


def beside_itself(network: SurveyNetwork, length_m: float) -> SurveyNetwork:
    """Return a network so often, one beside the other, that it has a length, m; the last one ends there."""
    count = int(np.ceil(length_m / network.lengths_m.sum()))
    along = np.concatenate([[0.0], np.cumsum(np.tile(network.lengths_m, count))[:-1]])
    kept = along < length_m
    step = np.ptp(network.places_m, axis=0) * [0, 1, 0] + [0, _APART_M, 0]
    places = np.concatenate([network.places_m + k * step for k in range(count)])
    shots = np.concatenate([network.shots + k * len(network.places_m) for k in range(count)])
    across, lrud, joined, known, lowered = (
        np.concatenate([one] * count)[kept]
        for one in (network.across, network.lrud_m, network.joined, network.known, network.roof_lowered)
    )
    joined[-1, 1] = False
    middle = np.round((places.min(axis=0) + places.max(axis=0)) / 2)
    return SurveyNetwork(places - middle, shots[kept], across, lrud, joined, known, lowered, network.names * count)


def measure(name: str) -> Row:
    """Build a survey as one volume; return the seconds of each step, the processor time and the peak of memory.

    The peak is that of the process and of one other that works for it, if both were largest at one time.
    """
    kind, size = name.split()
    with tempfile.TemporaryDirectory() as folder:
        network = network_of_size(kind, float(size), Path(folder))
    clock = [time.perf_counter()]
    volume = solve_floors(network)
    clock.append(time.perf_counter())
    parts = build_shell(volume)
    clock.append(time.perf_counter())
    found = measure_enclosure(volume, parts).figures
    clock.append(time.perf_counter())
    row: dict[str, Any] = {"name": name, "length_m": float(network.lengths_m.sum()), "legs": len(network.shots)}
    row |= {"facets": len(volume.faces), "parts": len(parts)}
    row |= {name: found[name] for name in ("intrusion_mm", "gap_mm", "thin_mm")}
    row |= dict(zip(STEPS, np.diff(clock).tolist(), strict=True))
    row["processor_s"] = sum(os.times()[:4])
    kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    row["peak_gb"], row["child_gb"] = (resource.getrusage(kind).ru_maxrss / 2**20 for kind in kinds)
    return row


def _rows(names: list[str]) -> Iterable[Row]:
    for name in names:
        words = [sys.executable, "-m", "benchmarks.comparisons.volume.large", "--one", name]
        yield json.loads(subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True).stdout)


def table_of(rows: list[Row]) -> str:
    """Return the rows as a table, the shortest first."""
    lines = []
    for row in sorted(rows, key=lambda row: (row["name"].split()[0], row["length_m"])):
        total = sum(row[step] for step in STEPS)
        size = (f"{row['length_m']:,.0f}", f"{row['facets']:,}", f"{row['parts']:,}")
        times = [f"{row[step]:.1f}" for step in STEPS]
        each = f"{1000 * total / row['length_m']:.1f}"
        memory = f"{row['peak_gb']:.1f} + {row['child_gb']:.1f}"
        kind = row["name"].split()[0]
        lines.append((kind, *size, *times, f"{total:.0f}", f"{row['processor_s']:.0f}", each, memory))
    heads = ("m", "facets", "parts", *(f"{step}, s" for step in STEPS), "s in all", "processor, s", "ms a metre", "GB")
    return markdown_table(("survey", *heads), lines)


def main() -> int:
    """Measure what is missing; print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks volume-large", description=__doc__)
    parser.add_argument("--cave", type=float, nargs="*", default=_WITHIN_M, metavar="M", help="m from Sakany's middle")
    parser.add_argument("--deep", type=float, nargs="*", default=_DEEP_KM, metavar="KM", help="km of drifts")
    parser.add_argument("--caves", type=float, nargs="*", default=(), metavar="KM", help="km of it, beside each other")
    parser.add_argument("--one", metavar="NAME", help=argparse.SUPPRESS)
    a = parser.parse_args()
    if a.one:
        print(json.dumps(measure(a.one)))
        return 0
    names = [f"{kind} {size:g}" for kind in ("cave", "caves") for size in getattr(a, kind)]
    names += [f"mine {size:g}" for size in a.deep]
    rows = resume(RESULTS, names, _rows, "survey", lambda row: row["name"], lambda row: "processor_s" in row)
    print(table_of([row for row in rows if row["name"] in names]))
    return 0


if __name__ == "__main__":
    sys.exit(run_benchmark("volume-large", main))
