"""The page of `python -m benchmarks bench-gpu`; these tests need no GPU."""

import subprocess
import sys

from benchmarks.speed.time_gpu import table
from tests.project import ROOT


def test_a_figure_beyond_its_limit_is_shown():
    same = {"of_bare_floor": 0.7, "rays_per_s": 4e8}
    rows = [{"robots": n, "steps_per_s": 10.0 * n, "memory_gb": n / 4096, **same} for n in (8, 65_536)]
    text = table({"device": "a GPU", "cpu_threads": 16, "cpu_steps_per_s": 1e5, "rows": rows})
    assert "| control steps/s, all on the device | 655,360 | >= 1e+06: **missed** |" in text
    assert text.count("**missed**") == 1


def test_a_process_that_times_a_gpu_imports_no_stage():
    code = "import sys, benchmarks.speed.time_gpu; sys.exit('stages' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0
