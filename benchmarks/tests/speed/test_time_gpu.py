"""The page of `python -m benchmarks bench-gpu`, and what a run that is cut off leaves; these tests need no GPU."""

import json
import subprocess
import sys
from collections.abc import Iterator

import pytest

from baselines.base.markdown import BEGIN, END
from benchmarks.speed.time_gpu import table, write_figures
from tests.project import ROOT


def figures(*counts: int) -> dict:
    """Return the figures of a run as far as these counts of robots."""
    same = {"of_bare_floor": 0.7, "rays_per_s": 4e8}
    rows = [{"robots": n, "steps_per_s": 10.0 * n, "memory_gb": n / 4096, **same} for n in counts]
    return {"device": "NVIDIA H100", "cpu_threads": 16, "cpu_steps_per_s": 1e5, "rows": rows}


def test_the_memory_of_65536_robots_is_open_until_they_are_measured():
    assert "| GB of device memory at 65,536 robots | open | <= 40 |" in table(figures(1024, 4096))
    assert "| GB of device memory at 65,536 robots | 16 | <= 40 |" in table(figures(1024, 65_536, 131_072))


def test_a_figure_beyond_its_limit_is_marked():
    page = table(figures(65_536))  # 655,360 steps/s
    assert "| control steps/s, all on the device | 655,360 | >= 1e+06: **missed** |" in page
    assert page.count("**missed**") == 1


def test_a_run_that_is_cut_off_keeps_the_rows_that_it_measured(tmp_path):
    def cut_off() -> Iterator[dict]:
        yield figures(1024)
        yield figures(1024, 4096)
        raise KeyboardInterrupt

    out, page = tmp_path / "gpu.json", tmp_path / "page.md"
    page.write_text(f"{BEGIN}\n{END}")
    with pytest.raises(KeyboardInterrupt):
        write_figures(cut_off(), out, page)
    assert [row["robots"] for row in json.loads(out.read_text())["rows"]] == [1024, 4096]
    assert table(figures(1024, 4096)).strip() in page.read_text()


def test_no_page_is_written_without_a_gpu(tmp_path):
    write_figures([figures(8)], tmp_path / "gpu.json", None)
    assert [path.name for path in tmp_path.iterdir()] == ["gpu.json"]


def test_a_process_that_times_a_gpu_imports_no_stage():
    code = "import sys, benchmarks.speed.time_gpu; sys.exit('stages' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0
