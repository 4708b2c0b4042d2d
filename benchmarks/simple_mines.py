"""What a newcomer tries first: simple mines, each made by `pipeline new` in a copy of the project.

Boxes, bends, tees, rings, rooms and stubs, 1.6 to 12 m wide and 15 to 400 m long, in any direction, in metres, feet or
millimetres, as GeoJSON or DXF; every seventh is a station table with heights. Every mine is built with its visible rock
and judged by all limits of stage 6.
"""

from __future__ import annotations

import atexit
import shutil
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import ezdxf.filemanagement
import ezdxf.units
import numpy as np
import shapely
from shapely import LineString, Polygon, affinity

from benchmarks.judged_cases import JudgedCases, span
from benchmarks.results import Row
from benchmarks.worlds.random_levels import random_legs
from tests.heights import table as station_table
from tests.project import Project

_WIDTH_M, _LENGTH_M = (1.6, 12.0), (15.0, 400.0)
_UNITS = {"m": 1.0, "ft": 0.3048, "mm": 0.001}
_ROOM_SHARE = (0.3, 1.0)  # a room's width, of its length
_STUB_WIDTHS = (2.0, 6.0)  # a stub's length, in widths of the drift
_MESSAGE_CHARACTERS = 600  # characters of the last messages, which name the limits
_RING_WIDTHS = 3.0  # the rock within a ring is at least so wide
HEIGHTS = 7  # every so many mines one is a survey with heights


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
            unit = {"m": ezdxf.units.M, "ft": ezdxf.units.FT, "mm": ezdxf.units.MM}[self.unit]
            drawing = ezdxf.filemanagement.new(units=unit)
            for ring in (scaled.exterior, *scaled.interiors):
                drawing.modelspace().add_lwpolyline(list(ring.coords)[:-1], close=True)
            drawing.saveas(path)
            return ["--from", str(path)]
        path.write_text(shapely.to_geojson(scaled))
        return ["--from", str(path), "--unit", self.unit]


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


def judge(seed: int) -> Row:
    """Make one mine with `pipeline new` and return its exit code and its last messages."""
    with tempfile.TemporaryDirectory() as folder:
        if seed % HEIGHTS:
            mine = random_mine(seed)
            words, row = (
                mine.write(Path(folder)),
                {"kind": mine.kind, "width_m": mine.width_m, "length_m": mine.length_m},
            )
        else:
            kind, legs = random_legs(seed)
            path = Path(folder) / "mine.csv"
            path.write_text(station_table(legs))
            words, row = ["--from", str(path)], {"kind": f"{kind}, with heights"}
        return row | made(f"simple-{seed}", words)


def made(name: str, words: list[str]) -> Row:
    """Return the exit code and the last messages of `pipeline new` with some arguments; the world is removed."""
    project = _project()
    done = project.run(sys.executable, "-m", "pipeline", "new", name, *words)
    shutil.rmtree(project.folder / "artifacts" / "worlds" / name, ignore_errors=True)
    return {"exit_code": done.returncode, "messages": done.stderr[-_MESSAGE_CHARACTERS:].splitlines()}


@cache
def _project() -> Project:
    """Return the copy of the project that this process builds in; it is removed when the process ends."""
    folder = tempfile.mkdtemp(prefix="simple-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Project(Path(folder), tiny=False)


def note(rows: list[Row]) -> str:
    """Return a line for each mine that does not pass."""
    failed = [row for row in rows if row["exit_code"]]
    lines = [f"- seed {row['case']}, a {row['kind']}: {row['messages'][-1].strip()}\n" for row in failed]
    return "Not passed:\n\n" + "".join(lines) if lines else ""


SIMPLE_MINES = JudgedCases(
    name="simple-mines",
    cases=range(1000),
    sample=12,
    judge=judge,
    holds=lambda row: row["exit_code"] == 0,
    groups=lambda row: [row["kind"]],
    of="kind",
    columns={
        "mines": len,
        "pass": lambda rows: sum(row["exit_code"] == 0 for row in rows),
        "width, m": span("width_m", ".2f"),
        "length, m": span("length_m", ".0f"),
    },
    note=note,
)

if __name__ == "__main__":
    sys.exit(SIMPLE_MINES.run(__doc__))
