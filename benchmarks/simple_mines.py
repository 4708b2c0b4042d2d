"""The simplest mines that a newcomer draws, each made by `pipeline new`: a run goes on where the last one stopped.

Boxes, bends, tees, rings, rooms and stubs, 1.6 to 12 m wide and 15 to 400 m long, in any direction, in metres, feet or
millimetres, as GeoJSON or DXF. Every mine is built with its visible rock and judged by all limits of stage 6.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import ezdxf.filemanagement
import ezdxf.units
import numpy as np
import shapely
from shapely import LineString, Polygon, affinity

from baselines.base.markdown import markdown_table, write_table
from benchmarks.resume import resume
from tests.project import Project

RESULTS, TABLE = Path("artifacts/bench/simple-mines.jsonl"), Path("docs/evidence/parts/simple-mines.md")
_WIDTH_M, _LENGTH_M = (1.6, 12.0), (15.0, 400.0)
_UNITS = {"m": 1.0, "ft": 0.3048, "mm": 0.001}
_ROOM_SHARE = (0.3, 1.0)  # a room's width, of its length
_STUB_WIDTHS = (2.0, 6.0)  # a stub's length, in widths of the drift
_MESSAGE_CHARACTERS = 600  # characters of the last messages, which name the limits
_RING_WIDTHS = 3.0  # the rock within a ring is at least so wide


@dataclass(frozen=True)
class SimpleMine:
    """One mine as its author draws it: the outline in metres, the file's unit and format."""

    kind: str
    outline: Polygon
    width_m: float
    length_m: float
    unit: str
    suffix: str

    def write(self, folder: Path) -> list[str]:
        """Write the drawing into a folder and return the arguments of `pipeline new` that read it."""
        path = folder / f"mine{self.suffix}"
        scaled = affinity.scale(self.outline, 1 / _UNITS[self.unit], 1 / _UNITS[self.unit], origin=(0, 0))
        if self.suffix == ".dxf":
            write_dxf(path, scaled, self.unit)
            return ["--from", str(path)]
        path.write_text(shapely.to_geojson(scaled))
        return ["--from", str(path), "--unit", self.unit]


def write_dxf(path: Path, outline: Polygon, unit: str) -> None:
    """Write an outline, in units of the file, as closed polylines of a DXF that states its unit: m, ft or mm."""
    drawing = ezdxf.filemanagement.new(units={"m": ezdxf.units.M, "ft": ezdxf.units.FT, "mm": ezdxf.units.MM}[unit])
    for ring in (outline.exterior, *outline.interiors):
        drawing.modelspace().add_lwpolyline(list(ring.coords)[:-1], close=True)
    drawing.saveas(path)


def _drift(places_m: list[tuple[float, float]], width_m: float) -> Polygon:
    return LineString(places_m).buffer(width_m / 2, cap_style="flat", join_style="mitre")


def _box(rng: np.random.Generator, width_m: float, length_m: float) -> Polygon:
    return _drift([(0, 0), (length_m, 0)], width_m)


def _bend(rng: np.random.Generator, width_m: float, length_m: float) -> Polygon:
    turn = rng.choice([-1, 1]) * rng.uniform(np.pi / 9, np.pi / 2)
    first = rng.uniform(0.3, 0.7) * length_m
    rest = length_m - first
    return _drift([(0, 0), (first, 0), (first + rest * np.cos(turn), rest * np.sin(turn))], width_m)


def _tee(rng: np.random.Generator, width_m: float, length_m: float) -> Polygon:
    main, side = 0.6 * length_m, 0.4 * length_m
    at, angle = rng.uniform(0.3, 0.7) * main, rng.uniform(np.pi / 3, 2 * np.pi / 3)
    crosscut = _drift([(at, 0), (at + side * np.cos(angle), side * np.sin(angle))], width_m)
    return shapely.union(_drift([(0, 0), (main, 0)], width_m), crosscut)


def _ring(rng: np.random.Generator, width_m: float, length_m: float) -> Polygon:
    side = max(length_m / 4, (1 + _RING_WIDTHS) * width_m)
    deep = side * rng.uniform(0.7, 1.3)
    return shapely.box(0, 0, side, deep).exterior.buffer(width_m / 2, join_style="mitre")


def _room(rng: np.random.Generator, width_m: float, length_m: float) -> Polygon:
    long = min(length_m, 5 * width_m)
    return shapely.box(0, 0, long, max(width_m, rng.uniform(*_ROOM_SHARE) * long))


def _stub(rng: np.random.Generator, width_m: float, length_m: float) -> Polygon:
    at, far = rng.uniform(0.2, 0.8) * length_m, rng.uniform(*_STUB_WIDTHS) * width_m
    return shapely.union(_drift([(0, 0), (length_m, 0)], width_m), _drift([(at, 0), (at, far)], width_m))


KINDS = {"box": _box, "bend": _bend, "tee": _tee, "ring": _ring, "room": _room, "stub": _stub}


def random_mine(seed: int) -> SimpleMine:
    """Return one random mine; kinds take turns with the seed, and every second mine is parallel to the axes."""
    rng = np.random.default_rng(seed)
    kind = list(KINDS)[seed % len(KINDS)]
    width = float(np.exp(rng.uniform(*np.log(_WIDTH_M))))
    length = float(np.exp(rng.uniform(*np.log((max(_LENGTH_M[0], 3 * width), _LENGTH_M[1])))))
    outline = KINDS[kind](rng, width, length)
    turned = affinity.rotate(outline, 0.0 if seed // len(KINDS) % 2 else rng.uniform(0, 360), origin=(0, 0))
    unit, suffix = str(rng.choice(list(_UNITS))), str(rng.choice([".geojson", ".dxf"]))
    return SimpleMine(kind, turned, width, length, unit, suffix)


def judge(seed: int, project: Project, overrides: list[str]) -> dict[str, Any]:
    """Make one mine with `pipeline new` and return its exit code and its last messages."""
    mine, name = random_mine(seed), f"simple-{seed}"
    row: dict[str, Any] = {"seed": seed, "kind": mine.kind, "width_m": round(mine.width_m, 2), "unit": mine.unit}
    row |= {"length_m": round(mine.length_m), "format": mine.suffix[1:]}
    with tempfile.TemporaryDirectory() as folder:
        done = project.module("pipeline", "new", name, *mine.write(Path(folder)), *overrides)
    shutil.rmtree(project.folder / "artifacts" / "worlds" / name, ignore_errors=True)
    row["exit_code"] = done.returncode
    if done.returncode:
        row["messages"] = done.stderr[-_MESSAGE_CHARACTERS:].splitlines()
    return row


def table(rows: list[dict[str, Any]]) -> str:
    """Return the results by kind as Markdown."""
    counted = []
    for kind in (*KINDS, None):
        some = [row for row in rows if kind in (None, row["kind"])]
        if some:
            spans = (f"{min(r[k] for r in some):g} to {max(r[k] for r in some):g}" for k in ("width_m", "length_m"))
            passed = sum(row["exit_code"] == 0 for row in some)
            counted.append((kind or "all", len(some), passed, *spans))
    return markdown_table(("kind", "mines", "pass", "width, m", "length, m"), counted)


def tables(rows: list[dict[str, Any]]) -> str:
    """Return the table, and a line for each mine that does not pass."""
    failed = [row for row in rows if row["exit_code"]]
    lines = [
        f"- seed {row['seed']}, a {row['kind']} {row['width_m']} m wide: {row['messages'][-1].strip()}\n"
        for row in failed
    ]
    return table(rows) + ("\nNot passed:\n\n" + "".join(lines) if lines else "")


def _rows(wanted: list[int], jobs: int, overrides: list[str]) -> Iterator[dict[str, Any]]:
    """Judge mines side by side, each job in a copy of the project of its own."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(jobs) as pool:
        projects: SimpleQueue[Project] = SimpleQueue()
        for job in range(jobs):
            projects.put(Project(Path(folder) / str(job), tiny=False))

        def judged(seed: int) -> dict[str, Any]:
            project = projects.get()
            try:
                return judge(seed, project, overrides)
            finally:
                projects.put(project)

        yield from pool.map(judged, wanted)


def main() -> int:
    """Make the mines that have no result yet and write the table; exit code 2 if a mine fails."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.simple_mines", description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--again", action="store_true", help="make all mines again")
    parser.add_argument("overrides", nargs="*", help="for example preset=light; the page is then not written")
    a = parser.parse_args()
    if a.again:
        RESULTS.unlink(missing_ok=True)
    made = resume(
        RESULTS,
        range(a.count),
        lambda seeds: _rows(seeds, a.jobs, a.overrides),
        "mine",
        is_valid=lambda row: row["exit_code"] == 0,
    )
    found = sorted((row for row in made if row["seed"] < a.count), key=lambda row: row["seed"])
    failed = [row for row in found if row["exit_code"]]
    if not a.overrides:
        write_table(TABLE, tables(found))
    print(table(found), end="")
    for row in failed:
        print(row)
    return 2 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
