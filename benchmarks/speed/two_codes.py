"""Measure this code and that of another commit in one run, in turns: what users wait for, each beside its reference.

Both are what git has of them, build their worlds, and are measured by new processes of the same interpreter. Cells are
medians of the turns, of processor time and in brackets of the clock; the ratio is the median of the turns' ratios.
`--long` adds 5,000 steps of 64 robots and a cave of 35 km.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order
from tqdm import tqdm

from baselines.base.markdown import markdown_table
from benchmarks import CALLERS_ENVIRONMENT
from benchmarks.results import run_benchmark
from benchmarks.speed.one_code import ANT, DEFAULT
from pipeline.errors import ArtifactError
from tests.heights import spiral, table

Turn = dict[str, list[float]]  # figures of one code: seconds of the processor and of the clock, or one number
OTHER = "the other code"
_ONE, _PELL = Path(__file__).with_name("one_code.py"), "artifacts/worlds/pell/realism/world"
_SHORT, _TALL, _TURN_KM = 6, 14, 0.028 * math.pi  # turns of generated declines; a turn has a radius of 14 m
_CAVE_M, _LONG_CAVE_M, _CAVE, _APART_M = 1000.0, 35_000.0, "data/sakany/Sakany", 20.0


@dataclass(frozen=True)
class Row:
    """A row of the table: a figure over another one of the same turn, or over its own of the other code."""

    title: str
    figure: str
    wanted: float | None
    over: str = ""
    at_least: bool = False
    by_clock: bool = False


ROWS = (
    Row("64 robots in Wheal Pell, anew: share of the default's steps", "spread, default", 0.85, "anew, pell", True),
    Row("the same, the default placed anew too", "anew, default", None, "anew, pell"),
    Row("one robot: default", "one, default", 3, "bare"),
    Row("one robot: volume", "one, pell", 4, "bare"),
    Row("64 robots: default, spread", "spread, default", 1.5, "bare"),
    Row("64 robots: default, placed anew", "anew, default", None, "bare"),
    Row("64 robots: volume, spread", "spread, pell", None, "bare"),
    Row("64 robots: volume, placed anew", "anew, pell", 2, "bare"),
    *(
        row
        for steps in (360, 5000)
        for row in (
            Row(f"64 robots spread over the default, {steps:,} steps, MB", f"memory, {DEFAULT}, {steps}", 300),
            Row(f"{ANT}, {steps:,} steps, MB", f"memory, {ANT}, {steps}", None),
        )
    ),
    Row("import, make and reset: default", f"start, {DEFAULT}", 1.5, f"start, {ANT}"),
    Row("import, make and reset: Wheal Pell", "start, pell", 1.5, f"start, {ANT}"),
    Row("light volume: fixed part, s", "fixed", 0.5, OTHER),
    Row("light volume: a km of mine, s", "km of mine", 0.5, OTHER),
    Row("light volume: a km of real cave, s", "km of cave", 0.5, OTHER),
    Row("cave of 35 km with certificate, s of the clock", "long cave", 0.4, OTHER, by_clock=True),
    Row("cave of 35 km: largest process, GB", "long cave, memory", 3),
    Row("`new`, 100 m with rock, s", "rock", 0.5, OTHER),
    Row("a frame by OSMesa, 320 x 240, s", "frame", 0.5, OTHER),
    Row("default bundle, MB", "bundle", 15),
    Row("default bundle: first load, s", "load", 0.5),
    Row("default bundle: memory of the load, MB", "load, memory", 400),
    Row("report page of the default, MB", "report", 4),
)


@dataclass(frozen=True)
class Code:
    """A copy of the project's files of one commit."""

    root: Path

    def run(self, *words: str, threads: int | None = None) -> tuple[str, list[float], float]:
        """Run Python in the copy; return its output, seconds of processor and clock, and its largest process, MB."""
        start, environment = time.perf_counter(), {**CALLERS_ENVIRONMENT, "PYTHONPATH": str(self.root)}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # a user's second start reads compiled code
        environment |= {"OMP_NUM_THREADS": str(threads)} if threads else {}
        with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as errors:
            process = subprocess.Popen(
                [sys.executable, *words], cwd=self.root, env=environment, stdout=out, stderr=errors
            )
            _, status, usage = os.wait4(process.pid, 0)
            spent = [usage.ru_utime + usage.ru_stime, time.perf_counter() - start]
            process.returncode = os.waitstatus_to_exitcode(status)
            out.seek(0)
            errors.seek(0)
            if process.returncode and words[:2] != ("-m", "pipeline"):  # it ends with 2 beyond a limit
                raise ArtifactError(f"{' '.join(words[1:])}: {errors.read().strip()[-300:]}")
            return out.read(), spent, usage.ru_maxrss * 1024 / 1e6

    def part(self, *words: str) -> tuple[Turn, list[float]]:
        """Measure a part of `one_code` in a process; return its figures and the whole process's seconds."""
        output, spent, _ = self.run("-P", str(_ONE), *words, threads=1)
        found = json.loads(output.splitlines()[-1])
        file = found.pop("file")
        if file and not Path(file).is_relative_to(self.root):
            raise ArtifactError(f"{file}: another code than that of {self.root}")
        return {name: given if isinstance(given, list) else [given] for name, given in found.items()}, spent

    def new(self, name: str, *words: str) -> tuple[list[float], float]:
        """Make a world; return its seconds and largest process, MB. A certificate that does not hold is printed."""
        world = self.root / "artifacts/worlds" / name
        shutil.rmtree(world, ignore_errors=True)
        (self.root / f"conf/survey/{name}.yaml").unlink(missing_ok=True)
        _, spent, peak_mb = self.run("-m", "pipeline", "new", name, *words)
        metrics = world / "validation/metrics.json"
        if not metrics.is_file():
            raise ArtifactError(f"new {name} {' '.join(words)}: it made no world in {self.root.name}")
        if not json.loads(metrics.read_text())["certificate"]["holds"]:
            print(f"two-codes: {self.root.name} code, {name}: its certificate does not hold", file=sys.stderr)
        return spent, peak_mb


def copy_of(commit: str, folder: Path) -> Code:
    """Copy a commit's files into a folder and build the default world, its report and Wheal Pell."""
    subprocess.run(["git", "archive", "--output", f"{folder}.tar", commit], check=True)
    shutil.unpack_archive(f"{folder}.tar", folder, filter="data")
    code = Code(folder)
    code.run("-m", "pipeline.compose")
    code.part("build", "artifacts")
    code.run("-m", "pipeline", "report")
    code.new("pell", "preset=light", "--from", "data/wheal_pell/pell.3d")
    return code


def steps(code: Code) -> Turn:
    """Return seconds of a robot's step."""
    return code.part("steps", _PELL)[0]


def memory(code: Code, more: int = 0) -> Turn:
    """Return the largest memory of processes that step."""
    return {k: v for world in (DEFAULT, ANT) for k, v in code.part("memory", world, str(more))[0].items()}


def start(code: Code) -> Turn:
    """Return the seconds of processes that import, make and reset."""
    worlds = {DEFAULT: DEFAULT, "pell": _PELL, ANT: ANT}
    return {f"start, {name}": code.part("start", world)[1] for name, world in worlds.items()}


def light(code: Code) -> Turn:
    """Return the seconds of a light volume: of none, of a km of declines that wind, and of a km of a cave."""
    spent = []
    for turns in (_SHORT, _TALL):
        (code.root / f"decline{turns}.csv").write_text(table(spiral(turns)))
        spent.append(np.array(code.new(f"decline{turns}", "preset=light", "--from", f"decline{turns}.csv")[0]))
    of_km = (spent[1] - spent[0]) / ((_TALL - _SHORT) * _TURN_KM)
    fixed = spent[0] - _SHORT * _TURN_KM * of_km
    cave = (np.array(_cave(code, "cave", _CAVE_M)[0]) - fixed) / (_CAVE_M / 1000)
    return {"fixed": fixed.tolist(), "km of mine": of_km.tolist(), "km of cave": cave.tolist()}


def _cave(code: Code, name: str, length_m: float) -> tuple[list[float], float]:
    nodes, links = (np.loadtxt(code.root / f"{_CAVE}_{kind}.dat") for kind in ("nodes", "links"))
    nodes, links = joined_caves(nodes, links.astype(int) - 1, length_m)
    np.savetxt(code.root / f"{name}_nodes.dat", nodes, "%.6f")
    np.savetxt(code.root / f"{name}_links.dat", links + 1, "%d")
    return code.new(name, "preset=light", "--from", f"{name}_nodes.dat", "--half-width", "1.0")


def joined_caves(nodes: np.ndarray, links: np.ndarray, length_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what is nearest to a cave's first station, in links, of copies to the north, each joined to the next.

    Parameters
    ----------
    nodes : (n, 3) float64, m
    links : (k, 2) int
        From 0.
    length_m : float
        The links that are kept have this length, less than one link more.
    """
    count = math.ceil(length_m / np.linalg.norm(np.diff(nodes[links], axis=1)[:, 0], axis=1).sum())
    size, step = len(nodes), np.array([0.0, np.ptp(nodes[:, 1]) + _APART_M, 0.0])
    between = [[k * size + nodes[:, 1].argmax(), (k + 1) * size + nodes[:, 1].argmin()] for k in range(count - 1)]
    links = np.concatenate([*(links + k * size for k in range(count)), np.reshape(between, (-1, 2)).astype(int)])
    nodes = np.concatenate([nodes + k * step for k in range(count)])
    graph = coo_array((np.ones(len(links)), links.T), shape=(len(nodes), len(nodes))).tocsr()
    order = breadth_first_order(graph, 0, directed=False, return_predecessors=False)
    rank = np.full(len(nodes), len(nodes))
    rank[order] = np.arange(len(order))
    links = links[rank[links].max(axis=1).argsort(kind="stable")]
    lengths_m = np.linalg.norm(np.diff(nodes[links], axis=1)[:, 0], axis=1)
    kept = links[: int(np.searchsorted(lengths_m.cumsum(), length_m)) + 1]
    used, numbers = np.unique(kept, return_inverse=True)
    return nodes[used], numbers.reshape(kept.shape)


def long_cave(code: Code) -> Turn:
    """Return the seconds and the memory of a long cave."""
    spent, peak_mb = _cave(code, "long", _LONG_CAVE_M)
    return {"long cave": spent, "long cave, memory": [peak_mb / 1000]}


def rock(code: Code) -> Turn:
    """Return the seconds of the simplest mine with rock."""
    (code.root / "drift.geojson").write_text(shapely.to_geojson(shapely.box(0, 0, 100.0, 4.6)))
    return {"rock": code.new("drift", "--from", "drift.geojson", "--unit", "m")[0]}


def default(code: Code) -> Turn:
    """Return a frame's seconds, the size and the first load of the default bundle, and the size of its report."""
    bundle = code.root / "artifacts/realism/world"
    size = sum(file.stat().st_size for file in bundle.rglob("*") if file.is_file())
    sizes = {"bundle": [size / 1e6], "report": [(code.root / "artifacts/report/report.html").stat().st_size / 1e6]}
    return code.part("frame")[0] | code.part("load", str(bundle))[0] | sizes


PARTS: dict[str, Callable[[Code], Turn]] = {f.__name__: f for f in (steps, memory, start, light, rock, default)}
_LONG: dict[str, Callable[[Code], Turn]] = {"memory": lambda code: memory(code, 5000), "long-cave": long_cave}


def cells(row: Row, turns: list[tuple[Turn, Turn]]) -> tuple[str, ...] | None:
    """Return a row's cells of turns of the other and of this code; None if it was not measured."""
    if any(row.figure not in code or row.over not in ("", OTHER, *code) for turn in turns for code in turn):
        return None
    over = row.over if row.over != OTHER else ""
    value = np.array(
        [[np.divide(code[row.figure], code[over] if over else 1.0) for code in turn] for turn in turns]
    )  # (turns, codes, clocks)
    ratio = np.median(value[:, 1] / value[:, 0], axis=0)
    sides = np.median(value, axis=0)
    judged = float((ratio if row.over == OTHER else sides[1])[-1 if row.by_clock else 0])
    met = row.wanted is None or (judged >= row.wanted if row.at_least else judged <= row.wanted)
    wanted = "" if row.wanted is None else f"{'>=' if row.at_least else '<='} {row.wanted:g}"
    shown = (" ".join(f"{n:.3g}" if k == 0 else f"({n:.3g})" for k, n in enumerate(some)) for some in (*sides, ratio))
    reference = {"bare": "bare robot", "anew, pell": "default", OTHER: "other code"}.get(row.over, row.over[7:])
    return (row.title, reference, *shown, wanted, "" if row.wanted is None else "yes" if met else "**no**")


def measure(codes: tuple[Code, Code], parts: dict[str, Callable[[Code], Turn]], count: int) -> list[tuple[Turn, Turn]]:
    """Measure both codes in turns; a part that fails in one is left out, and its error is printed."""
    turns: list[tuple[Turn, Turn]] = [({}, {}) for _ in range(count)]
    for turn, (name, part) in tqdm([(t, p) for t in turns for p in parts.items()], unit="part", disable=None):
        for figures, code in zip(turn, codes, strict=True):
            try:
                figures |= part(code)
            except (ArtifactError, FileNotFoundError) as error:
                print(f"two-codes: {name} is left out: {error}", file=sys.stderr)
    return turns


def main() -> int:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks two-codes", description=__doc__)
    parser.add_argument("parts", nargs="*", help=f"default: {' '.join(PARTS)}")
    parser.add_argument("--commit", default="6cab59b8", help="the other code")
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--long", action="store_true", help="also what takes long")
    given = parser.parse_args()
    parts = {**PARTS, **_LONG} if given.long else PARTS
    if unknown := set(given.parts) - set(parts):
        parser.error(f"no part {min(unknown)!r}; there are {', '.join(parts)}")
    chosen = {name: parts[name] for name in given.parts or parts}
    with tempfile.TemporaryDirectory(prefix="two-codes-") as folder:
        commits = {"other": given.commit, "this": "HEAD"}
        codes = [copy_of(commit, Path(folder).resolve() / name) for name, commit in commits.items()]
        load = os.getloadavg()[0]
        turns = measure((codes[0], codes[1]), chosen, given.turns)
    loads = f"a load of {load:.1f} before and {os.getloadavg()[0]:.1f} after"
    print(
        f"{given.turns} turns on {os.cpu_count()} cores, {loads}; seconds, or ratios, of the processor (the clock).\n"
    )
    rows = [found for row in ROWS if (found := cells(row, turns))]
    titles = ("figure", "reference", given.commit, "this code", "this / other", "wanted", "met")
    print(markdown_table(titles, rows), end="")
    return 0


if __name__ == "__main__":
    sys.exit(run_benchmark("two-codes", main))
