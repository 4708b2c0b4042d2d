"""What a newcomer tries first, each as a command in a copy of the project, and whether it ends as it should."""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import shapely
from shapely import LineString
from shapely.geometry.base import BaseGeometry
from tqdm import tqdm

from baselines.base.markdown import markdown_table, write_table
from benchmarks.simple_mines import write_dxf
from tests.project import Project

TABLE = Path("docs/evidence/parts/first-touch.md")
_FOOT_M = 0.3048
_SCRIPT = """import gymnasium, minexplore
env = gymnasium.make("MineXplore/ChileanMine-v0", world="{world}", render_mode="rgb_array")
env.reset(seed=0)
env.render()
"""


def _drift(*places_m: tuple[float, float], width_m: float = 4.6) -> BaseGeometry:
    return LineString(places_m).buffer(width_m / 2, cap_style="flat", join_style="mitre")


PLANS: dict[str, BaseGeometry] = {
    "a box, 180 x 4.6 m": _drift((0, 0), (180, 0)),
    "a box, 40 x 3 m": _drift((0, 0), (40, 0), width_m=3),
    "a narrow drift, 60 x 1.6 m": _drift((0, 0), (60, 0), width_m=1.6),
    "a bend of 90 deg, 5 m wide": _drift((0, 0), (70, 0), (70, 50), width_m=5),
    "a bend of 30 deg": _drift((0, 0), (60, 0), (110, 29)),
    "a T": _drift((0, 0), (100, 0)).union(_drift((50, 0), (50, 60))),
    "a stub": _drift((0, 0), (120, 0)).union(_drift((70, 0), (70, 12))),
    "a ring": shapely.box(0, 0, 60, 45).exterior.buffer(2.3, join_style="mitre"),
    "a room, 60 x 12 m": shapely.box(0, 0, 60, 12),
    "a room, 40 x 30 m": shapely.box(0, 0, 40, 30),
}
_HEAD = "leg,station,easting_m,northing_m,elevation_m,left_m,right_m,up_m,down_m\n"


def _table(*rows: tuple[str, str, float, float, float]) -> str:
    return _HEAD + "".join(f"{leg},{at},{x},{y},{z},2,2,3,0\n" for leg, at, x, y, z in rows)


SURVEYS = {
    "two stations, 12 % down": _table(("A", "1", 0, 0, 0), ("A", "2", 100, 0, -12)),
    "two stations, level": _table(("A", "1", 0, 0, 5), ("A", "2", 60, 0, 5)),
    "a bend down": _table(("A", "1", 0, 0, 0), ("A", "2", 50, 0, -5), ("A", "3", 80, 40, -10)),
    "a T on a slope": _table(
        *(("A", "1", 0, 0, 100), ("A", "2", 60, 0, 96), ("A", "3", 120, 30, 90)),
        *(("B", "2", 60, 0, 96), ("B", "4", 60, 50, 99)),
    ),
    "a cross on a slope": _table(
        *(("A", "1", 0, 0, 20), ("A", "2", 50, 0, 15), ("A", "3", 100, 0, 10)),
        *(("B", "4", 50, 50, 15), ("B", "2", 50, 0, 15), ("B", "5", 50, -50, 12)),
    ),
    "a loop": _table(
        *(("A", "1", 0, 0, 0), ("A", "2", 60, 0, -3), ("A", "3", 60, 50, -6)),
        *(("A", "4", 0, 50, -3), ("A", "1", 0, 0, 0)),
    ),
    "two levels and a winze": _table(
        *(("A", "1", 0, 0, 0), ("A", "2", 40, 0, 0), ("A", "3", 80, 0, 0)),
        *(("B", "2", 40, 0, 0), ("B", "5", 40, 0.5, -20)),
        *(("C", "5", 40, 0.5, -20), ("C", "6", 90, 0.5, -21)),
    ),
    "down and up again": _table(("A", "1", 0, 0, 0), ("A", "2", 60, 0, -6), ("A", "3", 120, 0, 0)),
    "a decline of seven stations": _table(
        *(("A", str(i), x, y, -3.0 * i) for i, (x, y) in enumerate([(0, 0), (30, 0), (55, 15), (60, 45), (40, 65)])),
        *(("A", str(5 + i), x, y, -15.0 - 3 * i) for i, (x, y) in enumerate([(10, 70), (-15, 55)])),
    ),
}
REAL = {
    "Wheal Pell, a mine": ["pell", "--from", "data/wheal_pell/pell.3d"],
    "Sakany, a cave": ["sakany", "--from", "data/sakany/Sakany_nodes.dat", "--half-width", "1"],
}


@dataclass(frozen=True)
class Trial:
    """One thing that a newcomer tries: what, the command's words, and whether its exit code and messages are right."""

    what: str
    words: list[str]
    is_right: Callable[[int, str], bool]


def _passes(code: int, _: str) -> bool:
    return code == 0


def _is_silent(code: int, messages: str) -> bool:
    return code == 0 and not messages.strip()


def trials(folder: Path) -> Iterator[Trial]:
    """Write the files into a folder and return the trials that read them, in the order of the table."""
    for number, (what, outline) in enumerate(PLANS.items()):
        path = folder / f"plan{number}.geojson"
        path.write_text(shapely.to_geojson(outline))
        yield Trial(f"plan: {what}", ["new", f"plan{number}", "--from", str(path), "--unit", "m"], _passes)
    for number, (what, text) in enumerate(SURVEYS.items()):
        path = folder / f"survey{number}.csv"
        path.write_text(text)
        yield Trial(f"survey with z: {what}", ["new", f"survey{number}", "--from", str(path)], _passes)
    for what, words in REAL.items():
        yield Trial(f"shipped survey with z: {what}", ["new", *words], _passes)
    write_dxf(folder / "feet.dxf", shapely.box(0, 0, 600, 15), "ft")
    yield Trial("a rectangle of 600 x 15 ft, DXF in feet", ["new", "feet", "--from", str(folder / "feet.dxf")], _passes)
    for name in ("plan0", "survey3", "feet"):
        bundle = f"artifacts/worlds/{name}/realism/world"
        yield Trial(f"certify the world {name}", ["certify", "--bundle", bundle, "--contacts", "500"], _passes)
    yield Trial(
        "contours.tolerance_m=-1",
        ["set-overrides", "contours.tolerance_m=-1"],
        lambda code, messages: code == 2 and "contours.tolerance_m" in messages and "validation" not in messages,
    )


def run(project: Project, trial: Trial) -> tuple[bool, str]:
    """Return whether a trial ends as it should, and the last line of its messages."""
    env = {"OVERRIDES": trial.words.pop()} if trial.words[0] == "set-overrides" else {}
    command = [sys.executable, "-m", "pipeline", *trial.words]
    done = project.run(*command, check=False, **env)
    lines = done.stderr.strip().splitlines()
    return trial.is_right(done.returncode, done.stderr), lines[-1] if lines else ""


def main() -> int:
    """Run all trials and write the table; exit code 2 if one does not end as it should."""
    argparse.ArgumentParser(prog="python -m benchmarks.first_touch", description=__doc__).parse_args()
    rows, failed = [], 0
    with tempfile.TemporaryDirectory() as place:
        project = Project(Path(place) / "project", tiny=False)
        for trial in tqdm(list(trials(Path(place))), unit="trial", disable=None):
            right, last = run(project, trial)
            failed += not right
            rows.append((trial.what, "as it should" if right else f"**{last.strip()[:160]}**"))
        script = _SCRIPT.format(world=project.folder / "artifacts/worlds/plan1/realism/world")
        done = project.run(sys.executable, "-c", script)
        silent = _is_silent(done.returncode, done.stderr)
        failed += not silent
        rows.append(("a script that renders and ends without close()", "silent" if silent else done.stderr[-160:]))
        shutil.rmtree(project.folder / "artifacts" / "worlds")
    table = markdown_table(("tried", "ended"), rows)
    write_table(TABLE, table)
    print(table, end="")
    return 2 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
