"""Mines with heights through `python -m pipeline new`, with visible rock."""

import json
import sys

import numpy as np
import pytest
import yaml
from matplotlib.tri import LinearTriInterpolator, Triangulation

from pipeline.geometry.polyline import arc_length
from pipeline.store.codecs import decode
from pipeline.survey.solved.station_table import read_stations
from pipeline.types import FloorMesh
from tests.heights import UNDER, levels, seam, shelves, spiral, table
from tests.project import ROOT, Project

pytestmark = pytest.mark.slow
CASES = {"spiral": spiral(3), "levels": levels(), "seam": seam(), "under": UNDER, "shelves": shelves()}
GRADE_DEG = 0.2


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


def test_the_embedded_mine_with_a_grade_for_each_leg_holds_its_certificate(project):
    for stage in ("survey", "contours", "compile3d", "surface", "realism", "validation"):
        done = project.stage(stage, "survey=graded")
        assert done.returncode == 0, done.stderr
    root = project.folder / "artifacts"
    assert json.loads((root / "validation/certificate.json").read_text())["holds"]
    mesh = decode(root / "contours/traced/floors.npz", FloorMesh)
    x, y, z = mesh.vertices.T
    height_at = LinearTriInterpolator(Triangulation(x, y, mesh.faces), z)
    stated = yaml.safe_load((ROOT / "conf/survey/graded.yaml").read_text())["survey"]["grade"]
    for leg in read_stations(ROOT / "data/chilean_mine/stations.csv"):
        want = np.degrees(np.arctan(stated[leg.name]))
        found = height_at(*leg.positions_m[:, :2].T)
        here = np.flatnonzero(~np.ma.getmaskarray(found))  # the end of one is narrower than the plan's pixels
        run, rise = arc_length(leg.positions_m)[here], found.data[here]
        assert np.degrees(np.arctan2(rise[-1] - rise[0], run[-1] - run[0])) == pytest.approx(want, abs=GRADE_DEG)
