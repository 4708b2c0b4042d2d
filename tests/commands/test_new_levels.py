"""Mines with heights through `python -m pipeline new`, with visible rock."""

import json
import sys

import pytest

from tests.heights import levels, seam, shelves, spiral, table
from tests.project import Project

pytestmark = pytest.mark.slow
CASES = {"spiral": spiral(2), "levels": levels(), "seam": seam(), "shelves": shelves()}


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    folder = tmp_path_factory.mktemp("levels") / "mine"
    folder.mkdir()
    return Project(folder, tiny=False)


@pytest.mark.parametrize("name", CASES)
def test_a_generated_mine_with_heights_comes_out_whole_without_an_option(name, project):
    (project.folder / f"{name}.csv").write_text(table(CASES[name]))
    done = project.run(sys.executable, "-m", "pipeline", "new", f"case-{name}", "--from", f"{name}.csv", COLUMNS="1000")
    assert done.returncode == 0, done.stderr
    metrics = json.loads((project.folder / f"artifacts/worlds/case-{name}/validation/metrics.json").read_text())
    assert metrics["certificate"]["holds"] == 1
    assert metrics["survey"]["share_built"] == pytest.approx(1, abs=1e-3)


def test_a_station_that_no_survey_has_is_refused_and_leaves_nothing(project):
    source = ("--from", "data/wheal_pell/pell.3d", "--piece", "pell.2023-11-25.99")
    done = project.run(sys.executable, "-m", "pipeline", "new", "pell-none", *source)
    assert done.returncode == 2
    last = done.stderr.splitlines()[-1]
    assert (
        "pell.3d: survey.piece = 'pell.2023-11-25.99': no station has this name; names like it are pell.2023-11-25.9"
        in last
    )
    assert not (project.folder / "artifacts/worlds/pell-none").exists()
    assert not (project.folder / "conf/survey/pell-none.yaml").exists()
