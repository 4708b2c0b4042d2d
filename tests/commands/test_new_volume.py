"""Surveys through `python -m pipeline new`: they pass with exit code 0, and bad ones get one line."""

import json
import re
import sys

import pytest

from tests.project import Project
from tests.volume_worlds import HEADER

pytestmark = pytest.mark.slow
# A junction on a slope, a winze to a level below, and a shaft with a crawl at its foot.
MINE = HEADER + (
    "A,1,0,0,100,2.5,2.5,3.5,0\nA,2,60,0,96,2.5,2.5,3.5,0\nA,3,120,30,90,2.5,2.5,3.5,0\n"
    "B,2,60,0,96,2,2,3,0\nB,4,60,50,99,2,2,3,0\n"
    "S,4,60,50,99,1,1,3,0\nS,5,60,50,85,1,1,2,0\nC,5,60,50,85,0.4,0.4,0.6,0\nC,6,75,50,85,0.4,0.4,0.6,0\n"
)


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    folder = tmp_path_factory.mktemp("volumes") / "mine"
    folder.mkdir()
    return Project(folder, tiny=False)


def new(project, name, text, *words):
    (project.folder / f"{name}.csv").write_text(text)
    command = [sys.executable, "-m", "pipeline", "new", name, "--from", f"{name}.csv", *words]
    return project.run(*command, check=False, COLUMNS="1000")


def test_a_survey_passes_whole_with_a_certificate_and_a_report(project):
    name = "junction-and-shaft"
    done = new(project, name, MINE, "preset=light")
    assert done.returncode == 0, done.stderr
    world = project.folder / "artifacts/worlds" / name
    metrics = json.loads((world / "validation/metrics.json").read_text())
    assert metrics["certificate"]["holds"] == 1
    assert metrics["survey"]["share_built"] == pytest.approx(1, abs=1e-3)
    record = json.loads((world / "realism/world/world.json").read_text())
    assert record["format"] == "minexplore-world/3"
    page = (world / "report/report.html").read_text()
    assert "What is measured, and what is assumed" in page
    assert "ends of the survey are closed by rock" in " ".join(done.stderr.split())
    assert "start   " in done.stdout
    assert "FAILS" not in project.run(sys.executable, "-m", "pipeline", "show", name).stdout
    listed = project.run(sys.executable, "-m", "pipeline", "list").stdout
    assert re.search(rf"^{name} +{metrics['survey']['built_m']:.0f} ", listed, re.M)
    varied = project.run(sys.executable, "-m", "pipeline", "worlds", "--of", name, "--count", "1", check=False)
    assert (varied.returncode, "this world is one volume" in varied.stderr) == (2, True)


def test_a_start_without_a_floor_is_refused_in_one_line_that_names_the_option(project):
    done = new(project, "far", MINE, "--start", "500,500", "preset=light")
    assert done.returncode == 2
    assert "--start moves it" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
