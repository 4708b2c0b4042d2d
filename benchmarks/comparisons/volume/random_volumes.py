"""Random mines and caves as one volume each, by the certificate's limits. A run goes on where the last one stopped.

`python -m benchmarks random-volumes` writes how many are clean, and why others are not. No bodies are thrown. Another
count is of those with under a nanometre of rock in the free space. MuJoCo's corners have 32 bits, 8 um at 100 m: no
body notices more of it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from baselines.base.markdown import markdown_table, write_table
from benchmarks.comparisons.volume.cases import GateCase
from benchmarks.comparisons.volume.random_caves import random_cave
from benchmarks.resume import resume, run_benchmark
from benchmarks.worlds.random_levels import random_legs
from pipeline.errors import MineError
from pipeline.geometry.facets.crossings import CROSSING_M, crossing_facets
from pipeline.volume.enclosure import measure_enclosure
from pipeline.volume.floor_error import measure_floor
from pipeline.volume.floors import solve_floors
from pipeline.volume.shell import build_shell
from pipeline.volume.world.content import in_mine_frame
from pipeline.volume.world.parts import labelled_parts, without_refused
from pipeline.volume.world.proof.fronts import fronts_of
from tests.heights import table

RESULTS = Path("artifacts/bench/volume-random.jsonl")
PAGE = Path("docs/evidence/parts/random-volumes.md")
_INTRUSION_MM = 0.01  # beside the limit of the certificate


def limits() -> dict[str, dict[str, float]]:
    """Return the certificate's limits by figure, and none of facets that cross."""
    groups = yaml.safe_load(Path("conf/validation/default.yaml").read_text())["volume"]["limits"]
    found = {f"{group}.{name}": limit for group, some in groups.items() for name, limit in some.items()}
    return found | {"crossings": {"max": 0.0}}


def table_of(kind: str, seed: int) -> str:
    """Return the station table of a random mine or cave."""
    return table(random_legs(seed)[1]) if kind == "mine" else random_cave(seed)


def judge(kind: str, seed: int) -> dict[str, Any]:
    """Return what was measured of one survey, or why it was refused."""
    row: dict[str, Any] = {"kind": kind, "seed": seed}
    with tempfile.TemporaryDirectory() as folder:
        try:
            return row | _measure(GateCase(f"{kind} {seed}", table_of(kind, seed)), Path(folder))
        except MineError as error:
            return row | {"refused_because": str(error).replace(folder, "")}
        except Exception as error:  # this one fails and the others go on
            return row | {"refused_because": f"{type(error).__name__}: {error}".replace(folder, "")}


def _measure(case: GateCase, folder: Path) -> dict[str, Any]:
    network = case.network(folder)
    volume = solve_floors(network)
    parts, refused = without_refused(build_shell(volume))
    mine = in_mine_frame(volume, np.zeros(3))
    fronts = fronts_of(volume, labelled_parts(parts, mine, np.zeros(3)))
    floor = measure_floor(volume, network)
    found = measure_enclosure(volume, fronts.parts, fronts.faces).figures
    return {
        "length_m": float(network.lengths_m.sum()),
        "parts": len(parts),
        "refused": refused,
        "survey.share_built": floor.share_built,
        "floor.error_mm": 1e3 * floor.error_m,
        "floor.step_mm": 1e3 * floor.step_m,
        "floor.other_step_mm": 1e3 * floor.other_step_m,
        **{f"enclosure.{name}": found[name] for name in ("intrusion_mm", "gap_mm", "thin_mm", "unbacked")},
        "crossings": len(crossing_facets(volume.vertices, volume.faces, CROSSING_M)),
    }


def beyond(row: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of a row that are beyond their limits, or why it was refused; nothing for a clean one."""
    if "refused_because" in row:
        return {"refused_because": row["refused_because"]}
    known = {name: limit for name, limit in limits().items() if name in row}
    return {
        name: row[name]
        for name, limit in known.items()
        if not limit.get("min", -np.inf) <= row[name] <= limit.get("max", np.inf)
    }


def _rows(kind: str, seeds: Iterable[int]) -> Iterable[dict[str, Any]]:
    return (judge(kind, seed) for seed in seeds)


def main() -> int:
    """Measure what is missing; print the table and what is not clean."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks random-volumes", description=__doc__)
    parser.add_argument("--mines", type=int, default=200)
    parser.add_argument("--caves", type=int, default=100)
    a = parser.parse_args()
    lines, bad = [], []
    for kind, count in (("mine", a.mines), ("cave", a.caves)):
        path = RESULTS.with_stem(f"{RESULTS.stem}-{kind}")
        rows = [row for row in resume(path, range(count), partial(_rows, kind), kind) if row["seed"] < count]
        failed = [(row, found) for row in rows if (found := beyond(row))]
        metres = sum(row.get("length_m", 0.0) for row in rows)
        least = sum(not beyond(row) and row["enclosure.intrusion_mm"] <= _INTRUSION_MM for row in rows)
        lines.append((f"random {kind}s", len(rows), len(rows) - len(failed), least, f"{metres:,.0f}"))
        bad += [
            (f"{kind} {row['seed']}", name, _figure(value)) for row, found in failed for name, value in found.items()
        ]
    text = markdown_table(("", "surveys", "clean", "and under 0.01 mm of intrusion", "surveyed, m"), lines)
    if bad:
        text += "\n\n" + markdown_table(("not clean", "figure", "is"), bad)
    write_table(PAGE, text)
    print(text)
    return 0


def _figure(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    sys.exit(run_benchmark("volume-random", main))
