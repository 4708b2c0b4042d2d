"""A folder of anybody's files: which are read, which need an option, which are refused."""

import os
import signal

import cv2
import numpy as np
import pytest

from benchmarks import files
from benchmarks.files import VERDICTS, main, table, try_file, try_folder
from pipeline.params.stated import StatedOptions
from tests.project import ROOT, TINY_STATIONS


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a folder with a survey, a plan without a scale, a broken drawing, and a file that is no survey."""
    monkeypatch.chdir(ROOT)
    (tmp_path / "sub").mkdir()
    (tmp_path / "mine.csv").write_text(TINY_STATIONS)
    picture = np.full((120, 200, 3), 255, np.uint8)
    picture[40:80, 20:180] = 40
    cv2.imwrite(str(tmp_path / "plan.png"), picture)
    (tmp_path / "plan.pgw").write_text("nothing\n")
    (tmp_path / "sub/bad.dxf").write_text("garbage\n")
    (tmp_path / "notes.doc").write_text("x")
    return tmp_path


def test_a_file_is_asked_about_if_an_option_helps_and_else_refused(folder):
    (folder / "plan.pgw").unlink()
    asked = try_file(folder / "plan.png", StatedOptions())
    assert (asked.verdict, asked.why.partition(";")[0]) == ("asked", "no scale bar found")
    refused = try_file(folder / "sub/bad.dxf", StatedOptions())
    assert (refused.verdict, refused.why.partition(";")[0].partition(" (")[0]) == ("refused", "not a DXF drawing")
    assert refused.peak_bytes > 1e7


@pytest.mark.slow
def test_a_folder_is_tried_file_by_file_and_left_as_it_was(folder):
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    (folder / "plan.pgw").unlink()
    outcomes = try_folder(folder, ["--half-width", "2"], 1)  # which no picture is read with
    assert {name: found.verdict for name, found in outcomes.items()} == {
        "mine.csv": "read",
        "notes.doc": "refused",
        "plan.png": "asked",
        "sub/bad.dxf": "refused",
    }
    assert "read as a station survey" in outcomes["mine.csv"].why
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == {
        path: data for path, data in before.items() if path.suffix != ".pgw"
    }
    text = table(outcomes)
    assert text.startswith("| format | " + " | ".join(VERDICTS))
    assert "| .csv | 1 | 0 | 0 | 0 | 0 |" in text


@pytest.mark.slow
def test_the_worlds_of_a_folder_are_built_and_judged_and_the_project_stays_as_it_was(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    (tmp_path / "mine.csv").write_text(TINY_STATIONS)
    (tmp_path / "bad.stl").write_text("garbage")
    before = sorted(path.name for path in (ROOT / "data/mines").glob("*"))
    out = tmp_path / "table.txt"
    assert main([str(tmp_path), "--build", "--jobs", "1", "--out", str(out), "preset=light"]) == 0
    rows = out.read_text().splitlines()
    assert any("| mine.csv | built |" in row and "the certificate holds" in row for row in rows)
    assert any(row.startswith("| bad.stl | refused |") for row in rows)
    assert sorted(path.name for path in (ROOT / "data/mines").glob("*")) == before
    assert "mine.csv" in capsys.readouterr().out


def test_a_process_that_computes_too_long_is_ended_by_its_processor_time(monkeypatch):
    monkeypatch.setattr(files, "_TIME_S", 1)
    pid = os.fork()
    if not pid:
        files._limit_process()
        while True:
            pass
    assert os.WTERMSIG(os.waitpid(pid, 0)[1]) == signal.SIGXCPU
