"""Time and memory to load a model in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import mujoco

from pipeline.errors import ArtifactError

_LOADS, _ENOUGH_S = 4, 2.0  # at least two loads, then more within so many seconds: other work only adds time
_KIB_PER_MB = 1e6 / 1024


@dataclass(frozen=True)
class LoadCost:
    """Seconds of the first load in a process and of the fastest later one, and the memory of the first load.

    Later loads use the meshes that MuJoCo caches. `load_memory_mb` (10^6 bytes) is the peak resident memory during the
    first load, minus the peak before it, after `import mujoco`.
    """

    first_load_s: float
    load_s: float
    load_memory_mb: int


def measure_load(model: Path) -> LoadCost:
    """Load a model several times in a process of its own, and return the time and memory.

    Raises
    ------
    ArtifactError
        If the process fails.
    """
    done = subprocess.run(
        [sys.executable, "-m", __name__, model],
        capture_output=True,
        text=True,
        env={**os.environ, "MUJOCO_GL": "disable"},  # it draws nothing, and OpenGL is a third of the import
    )
    if done.returncode:
        reason = done.stderr.rpartition("Error: ")[2].strip()[-300:]
        raise ArtifactError(f"{model}: a separate process cannot load it: {reason}")
    return LoadCost(**json.loads(done.stdout))


def _measure(model: Path) -> LoadCost:
    before = _peak_kib()
    seconds: list[float] = []
    peaks: list[int] = []
    while len(seconds) < 2 or (len(seconds) < _LOADS and sum(seconds) < _ENOUGH_S):
        start = time.perf_counter()
        mujoco.MjModel.from_xml_path(str(model))
        seconds.append(time.perf_counter() - start)
        peaks.append(_peak_kib())
        # MuJoCo keeps what the last model was made of, 0.3 GB: findings/mujoco-deleted-model-keeps-memory.sh.
        mujoco.MjModel.from_xml_string("<mujoco/>")
    memory = round((peaks[0] - before) / _KIB_PER_MB)
    return LoadCost(round(seconds[0], 4), round(min(seconds[1:]), 4), memory)


def _peak_kib() -> int:
    """Return the peak of this process's resident memory, KiB.

    Linux starts a child's `ru_maxrss` from its parent's, which may be larger, so `getrusage` serves other systems only.
    """
    status = Path("/proc/self/status")
    if not status.exists():
        import resource

        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak // 1024 if sys.platform == "darwin" else peak
    line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
    return int(line.split()[1])


if __name__ == "__main__":
    print(json.dumps(asdict(_measure(Path(sys.argv[1])))))
