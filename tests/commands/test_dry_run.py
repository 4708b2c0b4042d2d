"""`new --dry-run`: it reads a file as `new` does, lists what is guessed, draws what is found, and builds nothing."""

import shutil

import cv2
import numpy as np
import pytest

from pipeline.__main__ import parse
from pipeline.errors import run_command
from pipeline.survey.draw import draw_plan, frame_around
from tests.mines import TEE
from tests.project import ROOT, TINY_STATIONS

SHOWN = "artifacts/worlds/x/detected.png"


@pytest.fixture
def project(tmp_path, monkeypatch):
    """Return a project with nothing but its configuration and an empty registry, and work in it."""
    shutil.copytree(ROOT / "conf", tmp_path / "conf")
    (tmp_path / "data").mkdir()
    (tmp_path / "data/registry.txt").write_text("# name\tsha256\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def dry_run(*words):
    """Return the exit code of `new x --dry-run`."""
    arguments = parse(["new", "x", "--dry-run", *words])
    return run_command("new", lambda: arguments.run(arguments))


def files(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_what_a_plan_is_taken_for_is_listed_and_drawn_and_nothing_is_built(project, capsys):
    plan, _ = draw_plan(TEE, frame_around((-10, -20, 90, 60), 8.0), {}, 20.0, 40)
    cv2.imwrite("plan.png", plan)
    before = files(project)
    assert dry_run("--from", "plan.png") == 0
    out, err = capsys.readouterr()
    assert out == f"read    plan.png; nothing is built\ndrawn   {SHOWN}\n"
    assert err.count("guessed, dropped or assumed") == 1
    assert "scale: the bar is 160 px long" in " ".join(err.split())
    assert "--bar-length" in err
    after = files(project)
    shown = cv2.imdecode(np.frombuffer(after.pop(SHOWN), np.uint8), cv2.IMREAD_COLOR).astype(int)
    assert 0.02 < (shown[..., 1] - shown[..., [0, 2]].max(axis=2) > 30).mean() < 0.9  # green
    assert set(after) == set(before)


def test_the_plan_of_a_survey_is_drawn_where_asked(project, capsys):
    (project / "own.csv").write_text(TINY_STATIONS)
    before = files(project)
    assert dry_run("--from", "own.csv", "--detected", "seen.png", "compile3d.height_m=2.8") == 0
    err = capsys.readouterr().err
    assert "read as a station survey" in err
    assert "conf/survey/" not in err  # no section is written
    assert (cv2.imread("seen.png") < 128).mean() > 0.02  # the drifts
    assert set(files(project)) == {*before, "seen.png"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("contours.min_tunnel_m2=5000",), "no dark region larger than 5000 m2"),  # of stage 2
        (("contours.tolerence_m=1",), "contours.tolerence_m: unknown"),
    ],
)
def test_what_new_refuses_is_refused_and_leaves_nothing(project, capsys, words, message):
    plan, _ = draw_plan(TEE, frame_around((-10, -20, 90, 60), 8.0), {}, 20.0, 40)
    cv2.imwrite("plan.png", plan)
    before = files(project)
    assert dry_run("--from", "plan.png", *words) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.splitlines()[-1].startswith("new: ")  # after the table
    assert set(files(project)) == set(before)
    assert not (project / "artifacts").exists()


def test_a_mine_of_steep_legs_only_is_refused_before_it_is_built(project, capsys):
    header = "leg,station,easting_m,northing_m,left_m,right_m,elevation_m\n"
    (project / "own.csv").write_text(header + "A,a,0,0,1.5,1.5,100\nA,b,0,0,1.5,1.5,50\n")
    before = files(project)
    assert dry_run("--from", "own.csv") == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert "own.csv: no leg is flat enough for a floor" in last
    assert files(project) == before
