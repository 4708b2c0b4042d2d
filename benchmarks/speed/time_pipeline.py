"""Time the pipeline in a clean copy of the project and again without changes, each stage alone, and `pipeline new`."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import shapely

from baselines.base.markdown import markdown_table, write_table
from pipeline.compose import compose
from pipeline.report.results import read_metrics
from stages.__main__ import STAGES

TABLE = Path("docs/evidence/parts/timings.md")
_LIMITS = {"compile3d": 5.0, "surface": 25.0, "validation": 90.0}
_DRIFT_M = (100.0, 4.6)  # the simplest mine
_NEW_S = 10.0
_NARROW_PX_PER_M, _NARROW_S = 10, 60.0  # the plan with 2.67 km of narrow drifts
_AGAIN_S = 6.0  # DVC compares all files


@dataclass(frozen=True)
class StageRun:
    """What a command took: seconds, processor seconds with those of its children, and its largest process, MB."""

    seconds: float
    processor_s: float
    peak_mb: float


def main() -> int:
    """Time the runs, print the table and write it to `docs/`."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    with tempfile.TemporaryDirectory() as folder:
        for name in listed:
            target = Path(folder) / name
            if Path(name).is_file() and name != "dvc.lock":
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(name, target)
        subprocess.run(["git", "init", "-q"], cwd=folder, check=True)
        timed: list[tuple[str, float, StageRun | None, float | None]] = []
        make_all = sys.executable, "-m", "dvc", "repro"
        whole = _run(folder, *make_all)
        timed.append(("whole pipeline, clean", whole.seconds, whole, 90.0))
        again = [_run(folder, *make_all) for _ in range(3)]
        timed.append(("again, without changes", again[0].seconds, again[0], _AGAIN_S))
        best_s = min(run.processor_s for run in again)
        timed.append(("again, processor time, best of three", best_s, None, _AGAIN_S))
        loads = read_metrics(Path(folder) / "artifacts" / "validation")
        limit = compose([]).validation.limits["world.load_s"].max
        timed.append(("model load, the first in a process", loads["world.first_load_s"], None, None))
        timed.append(("model load, again", loads["world.load_s"], None, limit))
        for stage in STAGES:
            run = _run(folder, sys.executable, "-m", f"stages.{stage}")
            timed.append((f"stage {stage}", run.seconds, run, _LIMITS.get(stage)))
        new = _new(folder)
        timed.append(("new, a drift of 100 m with rock", new.seconds, new, _NEW_S))
        timed.append(("new, a drift of 100 m with rock, processor time", new.processor_s, None, _NEW_S))
        narrow = _new_narrow(folder)
        timed.append(("new, 2.67 km of narrow drifts with rock", narrow.seconds, narrow, _NARROW_S))
    text = markdown_table(("run", "seconds", "processor s", "peak MB", "limit, s"), map(_row, timed))
    write_table(TABLE, f"Measured on {os.cpu_count()} cores.\n\n{text}")
    print(text, end="")
    slow = [title for title, seconds, _, limit in timed if limit is not None and seconds > limit]
    if slow:
        print(f"bench-pipeline: over the limit: {', '.join(slow)}", file=sys.stderr)
    return 2 if slow else 0


def _new(folder: str) -> StageRun:
    """Make the simplest mine from a drawing, with visible rock and all checks."""
    source = Path(folder) / "drift.geojson"
    source.write_text(shapely.to_geojson(shapely.box(0, 0, *_DRIFT_M)))
    return _run(folder, sys.executable, "-m", "pipeline", "new", "drift", "--from", source.name, "--unit", "m")


def _new_narrow(folder: str) -> StageRun:
    """Make a mine from a plan with rough walls, with visible rock and all checks."""
    plan = "narrow.png"
    _run(folder, sys.executable, "-m", "benchmarks.worlds.rough_plan", plan)
    scale = "--px-per-m", str(_NARROW_PX_PER_M)
    return _run(folder, sys.executable, "-m", "pipeline", "new", "narrow", "--from", plan, *scale)


def _row(timed: tuple[str, float, StageRun | None, float | None]) -> tuple[str, ...]:
    title, seconds, run, limit = timed
    cost = (f"{run.processor_s:.1f}", f"{run.peak_mb:,.0f}") if run else ("", "")
    return title, f"{seconds:.1f}", *cost, "" if limit is None else f"{limit:g}"


def _run(folder: str, *command: str) -> StageRun:
    """Run a command in the project; exit with its error if it fails."""
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # as in the Makefile
    start = time.perf_counter()
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=errors)
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            errors.seek(0)
            sys.exit(f"{' '.join(command)}: {errors.read().decode(errors='replace')}")
    return StageRun(seconds, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024 / 1e6)


if __name__ == "__main__":
    sys.exit(main())
