"""How long a model takes to load, in a process that does nothing else: `python -m pipeline.mjcf.load_time mine.xml`."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import mujoco

from pipeline.errors import ArtifactError

_LOADS, _QUICK_S = 12, 1.5  # MuJoCo keeps meshes that it has read: loads are timed until that shows, or the tries end


@dataclass(frozen=True)
class LoadTime:
    """Seconds of a process's first load, and of the best of those after it, for which MuJoCo had kept the meshes."""

    first_load_s: float
    load_s: float


def measure_load(model: Path) -> LoadTime:
    """Load a model again and again in a process of its own and return how long it took.

    Raises
    ------
    ArtifactError
        If the process fails.
    """
    done = subprocess.run([sys.executable, "-m", __name__, str(model)], capture_output=True, text=True, check=False)
    if done.returncode:
        reason = done.stderr.rpartition("Error: ")[2].strip()[-300:]
        raise ArtifactError(f"{model}: a process of its own does not load it: {reason}")
    return LoadTime(**json.loads(done.stdout))


def _time_loads(model: Path) -> LoadTime:
    seconds: list[float] = []
    while len(seconds) < 2 or (len(seconds) < _LOADS and min(seconds[1:]) > _QUICK_S):
        start = time.perf_counter()
        mujoco.MjModel.from_xml_path(str(model))
        seconds.append(time.perf_counter() - start)
    return LoadTime(round(seconds[0], 4), round(min(seconds[1:]), 4))


if __name__ == "__main__":
    print(json.dumps(asdict(_time_loads(Path(sys.argv[1])))))
