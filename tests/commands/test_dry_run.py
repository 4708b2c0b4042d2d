"""`new --dry-run`: it reads a file as `new` does, lists what is guessed, draws what is found, and builds nothing."""

import shutil

import cv2
import numpy as np
import pytest
import shapely
import yaml
from shapely import Polygon

from pipeline.__main__ import parse
from pipeline.errors import run_command
from pipeline.import_mine import draft_import
from pipeline.params.stated import StatedOptions
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


def listed(err):
    """Return the columns of the table of remarks: counts, one text of what is said, and options."""
    lines = err.splitlines()
    (head,) = (line for line in lines if line.rstrip().endswith("overruled by"))
    what, by = head.index("what"), head.index("overruled by")
    rows = lines[lines.index(head) + 1 :]
    text = " ".join(" ".join(line[what:by] for line in rows).split())
    return [line[:what].strip() for line in rows], text, {line[by:].strip() for line in rows}


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


def room(side_m):
    """Return a room of 30 by 30 m with two square pillars."""
    pillars = [shapely.box(x, 7, x + side_m, 7 + side_m) for x in (7, 20)]
    return Polygon(shapely.box(0, 0, 30, 30).exterior, [pillar.exterior for pillar in pillars])


def test_drawn_pillars_of_a_square_metre_are_kept_and_smaller_ones_are_listed(project, capsys):
    path = project / "room.geojson"
    path.write_text(shapely.to_geojson(room(1.1)))
    section = yaml.safe_load(draft_import("x", path, StatedOptions(unit="m")).section)
    assert section["contours"]["min_island_m2"] == 1.0
    assert dry_run("--from", "room.geojson", "--unit", "m") == 0
    assert "islands" not in capsys.readouterr().err
    path.write_text(shapely.to_geojson(room(0.9)))
    assert dry_run("--from", "room.geojson", "--unit", "m") == 0
    counts, text, options = listed(capsys.readouterr().err)
    assert "islands in the workings are smaller than 1 m2 and are filled, 1.6 m2 in all" in text
    assert "(the largest, 0.8 m2, at (7.5, 7.5))" in text
    assert "2" in counts
    assert "contours.min_island_m2" in options


def test_islands_that_are_filled_in_a_picture_are_listed(project, capsys):
    plan, _ = draw_plan(room(3.0), frame_around((-10, -20, 90, 60), 8.0), {}, 20.0, 40)
    cv2.imwrite("plan.png", plan)
    assert dry_run("--from", "plan.png") == 0
    counts, text, _ = listed(capsys.readouterr().err)
    assert "islands in the workings are smaller than 10 m2" in text
    assert "2" in counts


RISE = {
    "own.csv": "leg,station,easting_m,northing_m,left_m,right_m,elevation_m\nA,a,0,0,2,2,10\nA,b,40,0,2,2,10.9\n",
    "own.geojson": shapely.to_geojson(Polygon([(0, 0, 10), (40, 0, 10.9), (40, 4, 10.9), (0, 4, 10)])),
    "own.plt": "M 0 0 0 Sa P 6 6 6 0\nD 0 140 2 Sb P 6 6 6 0\n",
}


@pytest.mark.parametrize("name", RISE)
def test_a_rise_under_a_metre_is_listed_unless_an_override_builds_it(project, capsys, name):
    (project / name).write_text(RISE[name])
    unit = ["--unit", "m"] if name == "own.geojson" else []
    assert dry_run("--from", name, *unit) == 0
    _, text, options = listed(capsys.readouterr().err)
    assert "m, no more than 1 m, and it is built level" in text
    assert "survey.flat_step_m=0" in options
    assert dry_run("--from", name, *unit, "survey.flat_step_m=0") == 0
    assert "built level" not in capsys.readouterr().err
    assert dry_run("--from", name, *unit, "survey.flat_step_m=-1") == 2
    assert "survey.flat_step_m = -1" in capsys.readouterr().err
