"""Pages of evidence that are older than the code that they measure, and their renewal.

A page states the day, the hash of the code and that of the default world that it was measured on. The code is the
import closure of the page's command, as in `artifacts/code.json`, with the files of the project that it reads and the
lock of its packages: a page is of one MuJoCo, so a renewed lock makes all pages stale.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

from benchmarks.measurements import BENCHMARKS, Benchmark
from minexplore.bundle import RECORD
from pipeline.places import WRITTEN_BY_NEW
from pipeline.store.files import write_atomically
from pipeline.store.hashing import import_closure, sha256_file, sha256_named

WORLD = Path("artifacts/realism/world") / RECORD
_DIGITS = 12  # of a hash that a page shows
_STATED = re.compile(
    r"^\*Measured on (\d{4}-\d\d-\d\d) by (?:code `(\w+)` and world `(\w+)`|earlier code)\.\*\n", re.MULTILINE
)
_TABLE = "<!-- table -->"
# What modules load or read by name, which no import statement shows.
_BY_NAME = {
    "stages/__main__.py": ("stages/*.py",),
    "minexplore/sensors/table.py": ("minexplore/sensors/kinds/*.py",),
    "minexplore/physics/robots.py": ("minexplore/physics/*.py",),
    "baselines/base/environments.py": ("minexplore/backends.py",),
    "tests/project.py": ("pipeline/__main__.py",),  # a copy of the project, in which its commands run
    "benchmarks/speed/time_pipeline.py": ("pipeline/__main__.py", "data/chilean_mine/stations.csv"),
    "benchmarks/claims.py": (
        "stages/validation.py",  # measures the world
        "baselines/results/bounds.json",
        "baselines/results/Chilean*/oracle-tour.jsonl",
    ),
    "baselines/ppo/curves.py": ("baselines/results/training/*.json",),
    "baselines/base/settings.py": ("conf/train/**/*.yaml",),
    "pipeline/compose.py": ("conf/**/*.yaml",),
    "benchmarks/comparisons/volume/random_volumes.py": ("conf/validation/default.yaml",),
    "benchmarks/comparisons/volume/cases.py": ("data/sakany/*.dat", "data/wheal_pell/*.3d"),
    "benchmarks/speed/growth.py": ("data/wheal_pell/*.3d",),
    "benchmarks/fuzzing/samples.py": ("conf/survey/plan.yaml",),
    "minesurveys/limits.py": ("minesurveys/limits.yaml",),
    "minexplore/physics/robot_kind.py": ("minexplore/physics/mjcf/*.xml",),
    "minexplore/sensing/params.py": ("minexplore/sensing/presets.json",),
    "minexplore/sensing/odometry.py": ("minexplore/sensing/odometry.json",),
    "minexplore/sensing/scanners/pattern_files.py": ("minexplore/sensing/scanners/patterns/*.json",),
}
# It names all environments, and a page that makes one imports its module, too.
_ENDS = ("minexplore/__init__.py",)
OUT_OF_TIME = 124  # exit code of what was ended at the budget, as that of timeout(1)


@dataclass(frozen=True)
class EvidencePage:
    """A page, the measurement that writes it, the day it was measured on, and why it is stale; empty if it is not."""

    page: Path
    benchmark: Benchmark
    day: str
    why: str


@dataclass(frozen=True)
class Begun:
    """A measurement that begins: the hash of its code, and its pages with when they were written, ns."""

    code: str
    written: dict[Path, int]


@cache  # pages share most of their modules
def _sha256(path: Path, written_ns: int) -> str:
    return sha256_file(path)


def code_of(benchmark: Benchmark, root: Path) -> str:
    """Return one hash of all files that a measurement depends on.

    They are the modules of its command, all that these import, the files that they read, and the lock of its packages.
    Files in `conf/` that `new` wrote for a mine do not count, as no page is measured in one.
    """
    wanted = [_file_of(module, root) for module in re.findall(r"python -m ([\w.]+)", benchmark.command)]
    closure = {Path(f"requirements/{benchmark.extra or 'dev'}.txt")}
    while wanted:
        file = wanted.pop()
        name = file.relative_to(root)
        if name in closure or (file.suffix == ".yaml" and WRITTEN_BY_NEW in file.read_text()):
            continue
        for source in import_closure(file, root, _ENDS) if file.suffix == ".py" else [name]:
            if source not in closure:
                closure.add(source)
                wanted += [found for pattern in _BY_NAME.get(source.as_posix(), ()) for found in root.glob(pattern)]
    return sha256_named({path.as_posix(): _sha256(root / path, _written(root / path)) for path in closure})[:_DIGITS]


def _file_of(module: str, root: Path) -> Path:
    path = root / module.replace(".", "/")
    return path / "__main__.py" if path.is_dir() else path.with_suffix(".py")


def world_of(root: Path) -> str:
    """Return the hash of the default world that lies in `artifacts/`; nothing if there is none."""
    path = root / WORLD
    return str(json.loads(path.read_bytes())["world_sha256"])[:_DIGITS] if path.is_file() else ""


def pages(root: Path) -> Iterator[EvidencePage]:
    """Yield each page of evidence with its day, and why it is stale."""
    world = world_of(root)
    for benchmark in BENCHMARKS:
        for name in benchmark.pages:
            text = (root / name).read_text() if (root / name).is_file() else ""
            found = _STATED.search(text)
            day, code, own = found.groups() if found else ("never", None, None)
            why = ""
            if code != code_of(benchmark, root):
                why = "older than the code" if code else "its code is not known"
            elif benchmark.default_world and world and own != world:
                why = "of another world"
            yield EvidencePage(Path(name), benchmark, day, why)


def begin(benchmark: Benchmark, root: Path) -> Begun:
    """Return what is true before a measurement, so that its pages state the code that it began with."""
    if not benchmark.pages:
        return Begun("", {})
    return Begun(code_of(benchmark, root), {Path(name): _written(root / name) for name in benchmark.pages})


def stamp(before: Begun, root: Path) -> None:
    """State day, code and world on the pages that were written since."""
    for name, written in before.written.items():
        if _written(root / name) == written:
            continue
        world = world_of(root) or "none"
        line = f"*Measured on {datetime.now(UTC):%Y-%m-%d} by code `{before.code}` and world `{world}`.*\n"
        write_atomically(root / name, stamped((root / name).read_text(), line).encode())


def stamped(page: str, line: str) -> str:
    """Return a page with a statement in place of its earlier one, or before its table."""
    return _STATED.sub(line, page, count=1) if _STATED.search(page) else page.replace(_TABLE, f"{line}\n{_TABLE}", 1)


def _written(path: Path) -> int:
    return path.stat().st_mtime_ns if path.is_file() else 0


def _stale(root: Path) -> dict[str, list[EvidencePage]]:
    """Return the stale pages by measurement: the cheapest first, and last those that change the packages of `.venv`."""
    found: dict[str, list[EvidencePage]] = {}
    for one in sorted(pages(root), key=lambda one: (one.benchmark.extra, one.benchmark.minutes or 0.0)):
        if one.why:
            found.setdefault(one.benchmark.name, []).append(one)
    return found


def _of_this_machine(found: dict[str, list[EvidencePage]]) -> list[Benchmark]:
    """Return the measurements of stale pages; without a GPU here, a line names those that need one."""
    every = [some[0].benchmark for some in found.values()]
    absent = [] if shutil.which("nvidia-smi") else [one for one in every if one.extra == "gpu"]
    if absent:
        print(f"{', '.join(one.name for one in absent)}: left out, as this machine has no GPU", flush=True)
    return [one for one in every if one not in absent]


def _hours_of(some: list[Benchmark]) -> float:
    return sum(one.minutes or 0.0 for one in some) / 60


def _linked_from(page: Path, root: Path) -> str:
    """Return the pages of `docs/` that link to a page of evidence, and may quote it."""
    docs = root / "docs"
    found = (path for path in sorted(docs.rglob("*.md")) if f"parts/{page.name}" in path.read_text())
    return ", ".join(path.relative_to(docs).as_posix() for path in found)


def stale(root: Path) -> int:
    """List what is older than the code, the cheapest first, with its cost; return 1 if there is something."""
    found = _stale(root)
    for name, some in found.items():
        for one in some:
            line = f"{one.benchmark.minutes:5g} min  {name:17} {one.page.name:22} measured {one.day}: {one.why}"
            print(f"{line}; see {_linked_from(one.page, root)}")
    here = _of_this_machine(found)
    if here:
        print(f"{_hours_of(here):.1f} h in all; `make evidence` renews them", flush=True)
    if not (root / WORLD).is_file():
        print(f"{WORLD}: missing, so worlds are not compared; `make all` makes it", file=sys.stderr)
    return int(bool(found))


def renew(root: Path, budget_h: float | None, measure: Callable[[Benchmark, float | None], int]) -> int:
    """Measure what is stale, the cheapest first; return 1 if something is left, fails, or misses a limit.

    What is done stays done: a later call goes on. A measurement that would end after the budget is not begun, and one
    that takes longer than it should is ended then. What needs another set-up than `make setup` comes last, as the
    others are measured with the packages of `make setup`.

    Parameters
    ----------
    root : Path
    budget_h : float, optional
    measure : callable
        Runs a measurement until a time of `time.monotonic`, if one is given, and returns its exit code.
    """
    every = _of_this_machine(_stale(root))
    print(f"{len(every)} measurements, about {_hours_of(every):.1f} h of two cores", flush=True)
    until = None if budget_h is None else time.monotonic() + 3600 * budget_h
    failed: list[str] = []
    left: list[str] = []
    for benchmark in every:
        if until is not None and time.monotonic() + 3600 * _hours_of([benchmark]) > until:
            left.append(benchmark.name)
            continue
        last = f"; last, as `make {benchmark.needs}` changes .venv" if benchmark.extra else ""
        print(f"{benchmark.name}, about {benchmark.minutes:g} min{last}", flush=True)
        code = measure(benchmark, until)
        (left if code == OUT_OF_TIME else failed).extend([benchmark.name] if code else [])
    if left:
        print(f"left: {', '.join(left)}")
    if failed:
        print(f"failed or beyond a limit: {', '.join(failed)}", file=sys.stderr)
    return int(bool(left or failed))
