import os

import pytest

from benchmarks.speed import processor_time

CASES = """
import subprocess, sys

def test_that_counts_here():
    sum(range(1_000_000))

def test_that_counts_in_a_child():
    subprocess.run([sys.executable, "-S", "-c", "sum(range(20_000_000))"], check=True)

def test_that_does_nothing():
    pass
"""


def test_the_dearest_test_comes_first_also_if_a_child_takes_its_time(tmp_path, monkeypatch, capsys):
    (tmp_path / "test_cases.py").write_text(CASES)
    monkeypatch.setattr(processor_time, "_seconds", {})
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    pytest.main(["-q", "-c", os.devnull, "-p", "no:cacheprovider", str(tmp_path)], plugins=[processor_time])
    lines = [line for line in capsys.readouterr().out.splitlines() if "::" in line]
    assert lines[0].endswith("::test_that_counts_in_a_child")
    assert len(lines) == 3
    assert float(lines[0].split()[0]) > 0.1
