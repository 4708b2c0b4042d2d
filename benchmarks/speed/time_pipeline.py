"""Time `dvc repro` on a clean copy of the project and again without changes, and each stage alone."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from baselines.base.markdown import markdown_table, write_table
from pipeline.compose import compose
from pipeline.report.results import read_metrics
from stages.__main__ import STAGES

TABLE = Path("docs/evidence/parts/timings.md")
_LIMITS = {"compile3d": 5.0, "surface": 25.0, "validation": 90.0}


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
        timed: list[tuple[str, float, float | None]] = [
            ("whole pipeline, clean", _seconds(folder, "dvc", "repro"), 90.0)
        ]
        again = [_times(folder, "dvc", "repro") for _ in range(3)]
        timed += [("again, without changes", again[0][0], 3.0)]
        timed += [("again, processor time, best of three", min(cpu for _, cpu in again), 3.0)]
        loads = read_metrics(Path(folder) / "artifacts" / "validation")
        limit = compose([]).validation.limits["world.load_s"].max
        timed += [("model load, the first in a process", loads["world.first_load_s"], None)]
        timed += [("model load, again", loads["world.load_s"], limit)]
        for stage in STAGES:
            timed += [(f"stage {stage}", _seconds(folder, sys.executable, "-m", f"stages.{stage}"), _LIMITS.get(stage))]
    rows = ((title, f"{seconds:.1f}", "" if limit is None else f"{limit:g}") for title, seconds, limit in timed)
    text = markdown_table(("run", "seconds", "limit"), rows)
    write_table(TABLE, f"Measured on {os.cpu_count()} cores.\n\n{text}")
    print(text, end="")
    slow = [title for title, seconds, limit in timed if limit is not None and seconds > limit]
    if slow:
        print(f"bench-pipeline: over the limit: {', '.join(slow)}", file=sys.stderr)
    return 2 if slow else 0


def _seconds(folder: str, *command: str) -> float:
    return _times(folder, *command)[0]


def _times(folder: str, *command: str) -> tuple[float, float]:
    """Run a command in the project; return its wall time and its processor time, s."""
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    subprocess.run(["git", "init", "-q"], cwd=folder, check=True)
    start, before = time.perf_counter(), _children_cpu_s()
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(command)}: {done.stderr}")
    return time.perf_counter() - start, _children_cpu_s() - before


def _children_cpu_s() -> float:
    """Return the processor time, s, of all finished child processes."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    sys.exit(main())
