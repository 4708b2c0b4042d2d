"""The page of `python -m benchmarks bench-gpu`, and what a run that is cut off leaves; these tests need no GPU."""

import subprocess
import sys

from benchmarks.speed.time_gpu import write_figures
from tests.project import ROOT


def figures(*counts: int) -> dict:
    """Return the figures of a run as far as these counts of robots."""
    same = {"of_bare_floor": 0.7, "rays_per_s": 4e8}
    rows = [{"robots": n, "steps_per_s": 10.0 * n, "memory_gb": n / 4096, **same} for n in counts]
    return {"device": "NVIDIA H100", "cpu_threads": 16, "cpu_steps_per_s": 1e5, "rows": rows}


def test_no_page_is_written_without_a_gpu(tmp_path):
    write_figures([figures(8)], tmp_path / "gpu.json", None)
    assert [path.name for path in tmp_path.iterdir()] == ["gpu.json"]


def test_a_process_that_times_a_gpu_imports_no_stage():
    code = "import sys, benchmarks.speed.time_gpu; sys.exit('stages' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0
