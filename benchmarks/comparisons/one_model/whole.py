"""The default mine built whole by both models, stage by stage and in turns, beside the figures of decision 29's gate.

A level plan leans with its world and has a rough floor; a slab has neither, so both are built without. The level model
is built once more as the project ships it.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import astuple, dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from baselines.base.markdown import markdown_table
from benchmarks import CALLERS_ENVIRONMENT
from benchmarks.comparisons.one_model.gate import ROWS, clause_rows, row_of
from benchmarks.results import run_benchmark
from benchmarks.speed.time_env import (
    one_robot_steps_per_s,
    paired_steps_per_s,
    start_at_entrance,
    start_spread,
)
from benchmarks.speed.time_pipeline import StageRun
from minexplore.bundle import MODEL, RECORD, ROUGH_MESH, GeomGroup, decode_msh, is_floor, is_rock, is_roof
from minexplore.envs.env import MineEnv
from minexplore.envs.vector import MineVectorEnv
from pipeline.compose import compose
from pipeline.errors import MineError
from pipeline.metrics.limits import flatten
from pipeline.metrics.navigability import cast_columns
from pipeline.mjcf.loading import load_model
from pipeline.proof.rebuilt.whole_bundle import tolerance_of
from pipeline.store.codecs import decode
from pipeline.store.mine_survey import open_survey
from pipeline.types import Mask
from stages.__main__ import STAGES
from tests.project import Project

_PLAIN = ("realism.rough_floor=false", "realism.tilt_deg=0")
MODELS = {"level": _PLAIN, "volume": ("+survey.grade=0.0", *_PLAIN)}
SHIPPED = "level as it ships"
_ROBOTS, _STEPS, _ALONE_STEPS, _RUNS = 64, 60, 400, 5
_BREACHED = 2  # exit code of stage 6 where figures are beyond their limits: its artifacts are written
_MESSAGE = 2000  # characters
_BUILDS = "builds.json"
_SPEED_TITLES = ("world", "steps/s of one robot", "of 64, spread over the mine", "of 64, at the entrance")

Figures = dict[str, float]


@dataclass(frozen=True)
class Whole:
    """One build of the six stages, and what stage 6 said of limits that are missed."""

    stages: Mapping[str, StageRun]
    missed: str

    @property
    def figures(self) -> Figures:
        """Return processor time and wall time of each stage and of all, s, and the largest memory, MB."""
        runs = self.stages
        found = {f"processor_s.{name}": run.processor_s for name, run in runs.items()}
        found |= {f"wall_s.{name}": run.seconds for name, run in runs.items()}
        for kind in ("processor_s", "wall_s"):
            found[f"{kind}.all"] = sum(found[f"{kind}.{name}"] for name in runs)
        return found | {"peak_mb": max(run.peak_mb for run in runs.values())}


def build(project: Project, overrides: tuple[str, ...], stages: tuple[str, ...] = STAGES) -> Whole:
    """Run the stages in a copy of the project, each as a process of its own.

    Raises
    ------
    MineError
        If a stage fails; the message has its own.
    """
    runs, missed = {}, ""
    for name in stages:
        runs[name], code, message = _run_stage(project.folder, name, overrides)
        if code == _BREACHED and "limits breached" in message:
            missed = message
        elif code:
            raise MineError(f"stages.{name} {' '.join(overrides)}: exit code {code}: {message}")
    return Whole(runs, missed)


def _run_stage(folder: Path, name: str, overrides: tuple[str, ...]) -> tuple[StageRun, int, str]:
    """Run one stage; return what it took with its children, its exit code and its messages."""
    environment = {key: value for key, value in CALLERS_ENVIRONMENT.items() if key != "PYTHONPATH"}
    start = time.perf_counter()
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", f"stages.{name}", *overrides],
            cwd=folder,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=errors,
        )
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        errors.seek(0)
        message = errors.read().decode(errors="replace").strip()[-_MESSAGE:]
    run = StageRun(seconds, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024 / 1e6)
    return run, process.returncode, message


def measured(artifacts: Path, overrides: tuple[str, ...]) -> Figures:
    """Return the figures of a world: those of stage 6, parts, columns, bytes and faces of the visible rock.

    Parts and columns are counted in the compiled model, in the same way for both.
    """
    world, figures = artifacts / "realism/world", flatten(_read(artifacts / "validation/metrics.json"))
    model, record = load_model(world / MODEL), _read(world / RECORD)
    names = [model.geom(number).name for number in range(model.ngeom)]
    config = compose(list(overrides))
    columns = cast_columns(
        model,
        np.array(record["T_world_mine"]),
        decode(artifacts / "contours/cleaned.png", Mask),
        open_survey(artifacts / "survey/mine").survey.frame,
        config.compile3d.height_m,
        tolerance_of(config.validation),
        GeomGroup.FLOOR,
        GeomGroup.COLLISION,
    )
    rock = [path for path in (world / "meshes").glob("*.msh") if re.fullmatch(ROUGH_MESH, path.stem)]
    return figures | {
        "parts": sum(is_floor(name) or is_rock(name) or is_roof(name) for name in names),
        "columns.blocked": columns.blocked,
        "columns.blocked_at_wall": columns.blocked_at_wall,
        "rock_faces": sum(len(decode_msh(path.read_bytes()).faces) for path in rock),
        "bundle_mb": sum(path.stat().st_size for path in world.rglob("*") if path.is_file()) / 1e6,
    }


def speeds(worlds: Mapping[str, Path], runs: int = _RUNS) -> dict[str, Figures]:
    """Return the steps/s in worlds, all in this process and in turns: medians, one thread, warm.

    One robot drives from the entrance. 64 robots are spread over the mine, then all start at the entrance.
    """
    alone = {name: MineEnv(folder) for name, folder in worlds.items()}
    many = {name: MineVectorEnv(_ROBOTS, folder, threads=1) for name, folder in worlds.items()}
    found: dict[str, list[Figures]] = {name: [] for name in worlds}
    for run in range(runs + 1):  # in the first one models and scenes are made
        for name in in_turn(tuple(worlds), run):
            rates = {"steps.one": one_robot_steps_per_s(alone[name], _ALONE_STEPS)}
            for key, start in (("steps.spread", start_spread), ("steps.entrance", start_at_entrance)):
                rates[key] = paired_steps_per_s((many[name],), start, _STEPS)[0]
            found[name].append(rates)
    return {name: medians(some[1:]) for name, some in found.items()}


def in_turn(names: tuple[str, ...], turn: int) -> tuple[str, ...]:
    """Return the order of a turn: A B, B A, A B, ..."""
    return names if turn % 2 == 0 else names[::-1]


def medians(some: list[Figures]) -> Figures:
    """Return the median of each figure; of memory the largest."""
    return {key: (max if key == "peak_mb" else median)(one[key] for one in some) for key in some[0]}


def compare(folder: Path, turns: int) -> str:
    """Build all, measure all, and return the tables. A build that a kept folder has already is not made again."""
    models: dict[str, tuple[str, ...]] = {**MODELS, SHIPPED: ()}
    projects = {name: _project(folder / name.replace(" ", "_")) for name in models}
    builds = {name: _kept(project.folder) for name, project in projects.items()}
    for turn in range(turns):
        for name in (*in_turn(tuple(MODELS), turn), *([SHIPPED] if turn == 0 else [])):
            if len(builds[name]) <= turn:
                builds[name].append(build(projects[name], models[name]))
                _keep(projects[name].folder, builds[name])
                total = builds[name][-1].figures["processor_s.all"]
                print(f"turn {turn + 1}, {name}: {total:.1f} s of processor time", file=sys.stderr)
    rates = speeds({name: project.folder / "artifacts/realism/world" for name, project in projects.items()})
    found, certificates = {}, {}
    for name, project in projects.items():
        artifacts = project.folder / "artifacts"
        found[name] = medians([one.figures for one in builds[name]]) | rates[name]
        found[name] |= measured(artifacts, models[name])
        certificates[name] = _read(artifacts / "validation/certificate.json")
    rows = [row_of(row, found["level"], found["volume"], found[SHIPPED]) for row in ROWS]
    gate = markdown_table(("figure", "wanted", "level", "volume", "ratio", "met", SHIPPED), rows)
    clauses = [cells for name in MODELS for cells in clause_rows(name, certificates[name]["clauses"])]
    proved = markdown_table(("model", "clause", "limit", "value", "holds"), clauses)
    missed = [f"{name}: {one.missed}\n" for name, some in builds.items() for one in some[-1:] if one.missed]
    return "\n".join([gate, proved, *missed])


def _project(folder: Path) -> Project:
    """Return the copy of the project in a folder, with composed parameters; a new one if there is none."""
    if folder.is_dir():
        return Project.at(folder)
    project = Project(folder, tiny=False)
    project.run(sys.executable, "-m", "pipeline.compose", check=True)
    return project


def _kept(folder: Path) -> list[Whole]:
    """Return the builds that were made in a copy of the project."""
    rows = _read(folder / _BUILDS) if (folder / _BUILDS).is_file() else []
    return [Whole({name: StageRun(*run) for name, run in row["stages"].items()}, row["missed"]) for row in rows]


def _keep(folder: Path, builds: list[Whole]) -> None:
    rows = [
        {"stages": {name: astuple(run) for name, run in one.stages.items()}, "missed": one.missed} for one in builds
    ]
    (folder / _BUILDS).write_text(json.dumps(rows))


def _read(path: Path) -> Any:
    return json.loads(path.read_bytes())


def main() -> int:
    """Read the command line, and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks one-model", description=__doc__)
    parser.add_argument("--turns", type=int, default=3, help="builds of each model; A B, B A, ...")
    parser.add_argument(
        "--folder", type=Path, help="of the copies of the project; it is kept, and a later call goes on with it"
    )
    parser.add_argument("--speeds", type=Path, nargs="+", metavar="WORLD", help="print the steps/s in bundles, alone")
    arguments = parser.parse_args()
    if arguments.speeds:
        found = speeds({str(world): world for world in arguments.speeds})
        rows = [(world, *(f"{rate:,.0f}" for rate in rates.values())) for world, rates in found.items()]
        print(markdown_table(_SPEED_TITLES, rows), end="")
        return 0
    before, kept = os.getloadavg()[0], arguments.folder
    with nullcontext(kept) if kept else tempfile.TemporaryDirectory(prefix="one-model-") as name:
        text = compare(Path(name), max(1, arguments.turns))
    loads = f"{before:.1f} and {os.getloadavg()[0]:.1f}"
    print(f"Turns: {max(1, arguments.turns)}. Load average of the machine before and after: {loads}.\n\n{text}", end="")
    return 0


if __name__ == "__main__":
    sys.exit(run_benchmark("one-model", main))
