"""Pages of evidence that are older than the code that they measure, and their renewal.

A page states the day, the hash of the code and that of the default world that it was measured on. The code is the
import closure of the page's command, as in `artifacts/code.json`.
"""

from __future__ import annotations

import json
import re
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

from benchmarks.measurements import BENCHMARKS, Benchmark
from minexplore.bundle import RECORD
from pipeline.store.files import write_atomically
from pipeline.store.hashing import import_closure, sha256_file, sha256_named

WORLD = Path("artifacts/realism/world") / RECORD
_DIGITS = 12  # of a hash that a page shows
_STATED = re.compile(
    r"^\*Measured on (\d{4}-\d\d-\d\d) by (?:code `(\w+)` and world `(\w+)`|earlier code)\.\*\n", re.MULTILINE
)
_TABLE = "<!-- table -->"
# What loads others by name, which no import statement shows, and these.
_BY_NAME = {
    "stages/__main__.py": "stages/*.py",
    "minexplore/sensors/table.py": "minexplore/sensors/kinds/*.py",
    "minexplore/physics/robots.py": "minexplore/physics/*.py",
    "baselines/base/environments.py": "minexplore/backends.py",
    "benchmarks/speed/time_pipeline.py": "pipeline/__main__.py",
    "tests/project.py": "pipeline/__main__.py",  # a copy of the project, in which its commands run
}
# It names all environments, and a page that makes one imports its module, too.
_ENDS = ("minexplore/__init__.py",)
_NO_DEVICE = 3  # exit code of what needs a GPU


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
    """Return one hash of all project modules that a measurement's command imports, directly or indirectly."""
    wanted = [_file_of(module, root) for module in re.findall(r"python -m ([\w.]+)", benchmark.command)]
    closure: set[Path] = set()
    while wanted:
        file = wanted.pop()
        if file.relative_to(root) in closure:
            continue
        for source in import_closure(file, root, _ENDS):
            if source not in closure:
                closure.add(source)
                wanted += root.glob(_BY_NAME.get(source.as_posix(), "-"))
    return sha256_named({path.as_posix(): _sha256(root / path, _written(root / path)) for path in closure})[:_DIGITS]


def _file_of(module: str, root: Path) -> Path:
    path = root / module.replace(".", "/")
    return path / "__main__.py" if path.is_dir() else path.with_suffix(".py")


def world_of(root: Path) -> str:
    """Return the hash of the default world that lies in `artifacts/`; nothing if there is none."""
    path = root / WORLD
    return str(json.loads(path.read_bytes())["world_sha256"])[:_DIGITS] if path.is_file() else ""


def pages(root: Path) -> Iterator[EvidencePage]:
    """Yield each page of evidence with its day, and why it is stale.

    A page that is measured in the default world is stale when the world's hash has changed.
    """
    world = world_of(root)
    for benchmark in BENCHMARKS:
        for name in benchmark.pages:
            text = (root / name).read_text() if (root / name).is_file() else ""
            found = _STATED.search(text)
            day, code, own = found.groups() if found else ("never", None, None)
            why = ""
            if code != code_of(benchmark, root):
                why = "older than the code" if code else "its code is not known"
            elif benchmark.needs == "all" and world and own != world:
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
    """Return the stale pages by measurement, the cheapest first."""
    found: dict[str, list[EvidencePage]] = {}
    for one in sorted(pages(root), key=lambda one: one.benchmark.minutes or 0.0):
        if one.why:
            found.setdefault(one.benchmark.name, []).append(one)
    return found


def stale(root: Path) -> int:
    """List what is older than the code, the cheapest first, with its cost; return 1 if there is something."""
    found = _stale(root)
    total = 0.0
    for name, some in found.items():
        minutes = some[0].benchmark.minutes or 0.0
        total += minutes
        for one in some:
            print(f"{minutes:5g} min  {name:17} {one.page.name:22} measured {one.day}: {one.why}")
    if found:
        print(f"{total / 60:.1f} h in all; `make evidence` renews them")
    if not (root / WORLD).is_file():
        print(f"{WORLD}: missing, so worlds are not compared; `make all` makes it", file=sys.stderr)
    return int(bool(found))


def renew(root: Path, budget_h: float | None, measure: Callable[[Benchmark], int]) -> int:
    """Measure what is stale, the cheapest first; return 1 if something is left, fails, or misses a limit.

    What is done stays done: a later call goes on. A measurement that would end after the budget is not begun.
    """
    found = _stale(root)
    every = [some[0].benchmark for some in found.values()]
    total_h = sum(benchmark.minutes or 0.0 for benchmark in every) / 60
    print(f"{len(every)} measurements, about {total_h:.1f} h of two cores", flush=True)
    start = time.monotonic()
    failed: list[str] = []
    left: list[str] = []
    for benchmark in every:
        spent_h = (time.monotonic() - start) / 3600
        if budget_h is not None and spent_h + (benchmark.minutes or 0.0) / 60 > budget_h:
            left.append(benchmark.name)
            continue
        print(f"{benchmark.name}, about {benchmark.minutes:g} min", flush=True)
        code = measure(benchmark)
        (left if code == _NO_DEVICE else failed).extend([benchmark.name] if code else [])
    if left:
        print(f"left: {', '.join(left)}")
    if failed:
        print(f"failed or beyond a limit: {', '.join(failed)}", file=sys.stderr)
    return int(bool(left or failed))
