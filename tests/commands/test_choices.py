"""Every choice of every group in conf/ goes through the whole pipeline, as by `make all OVERRIDES=...`."""

import json
from itertools import zip_longest

import numpy as np
import pytest
import yaml
from matplotlib.tri import LinearTriInterpolator, Triangulation

from pipeline.geometry.polyline import arc_length
from pipeline.places import CONF
from pipeline.store.codecs import decode
from pipeline.survey.solved.station_table import read_stations
from pipeline.types import FloorMesh
from stages.__main__ import STAGES
from tests.project import ROOT, Project

NOT_THE_PIPELINES = {"train"}  # the baselines' configuration
NEEDS = {"survey=plan": "the fetched plan", "survey=variant": "another mine's workings"}  # see the tests of these
OF_THE_EMBEDDED_MINE = {"preset=paper": "states its scale", "survey=graded": "states grades of its legs"}
ALONE = ("preset=light",)  # it leaves out what other groups choose
# A small mine needs fewer tiles than the 70 of the embedded one, of the same size; each tile takes seconds.
SMALLER = {
    "collision=coacd": "compile3d.collision.tiles=6",
    "collision=vhacd": "compile3d.collision.tiles=6",
    "survey=procedural": "survey.mine.size_m=[40,60]",
}
GRADE_DEG = 0.2
CHOICES = sorted(
    f"{path.parent.name}={path.stem}"
    for path in (ROOT / CONF).glob("*/*.yaml")
    if path.parent.name not in {*STAGES[1:], "mine", *NOT_THE_PIPELINES}
)
GROUPS = sorted({choice.partition("=")[0] for choice in CHOICES})


def together() -> list[str]:
    """Return overrides that have each choice once: those of different groups go together, a light world goes alone."""
    free = [choice for choice in CHOICES if choice not in {*NEEDS, *OF_THE_EMBEDDED_MINE, *ALONE}]
    of_group = [[c for c in free if c.startswith(f"{group}=")] for group in GROUPS]
    return [" ".join(filter(None, choices)) for choices in zip_longest(*of_group)] + list(ALONE)


def goes_through(project: Project, overrides: str) -> None:
    (project.folder / "requirements" / "setup.sh").write_text("exit 0\n")  # the copy uses the tests' environment
    done = project.run("make", "all", OVERRIDES=overrides)
    assert done.returncode == 0, done.stderr
    artifacts = project.folder / "artifacts"
    assert (
        json.loads((artifacts / "validation/certificate.json").read_text())["world_sha256"]
        in (artifacts / "report/report.html").read_text()
    )


@pytest.mark.slow
@pytest.mark.parametrize("overrides", together())
def test_every_choice_goes_through_make_all(repro, tmp_path, overrides):
    smaller = [SMALLER[choice] for choice in overrides.split() if choice in SMALLER]
    goes_through(repro.copy(tmp_path / "mine"), " ".join([overrides, *smaller]))


@pytest.mark.slow
def test_the_paper_s_choices_in_the_embedded_mine_go_through_make_all(tmp_path):
    goes_through(Project(tmp_path / "mine", tiny=False), "preset=paper")


@pytest.mark.slow
def test_the_embedded_mine_with_a_grade_for_each_leg_goes_through_make_all_and_holds_its_certificate(tmp_path):
    project = Project(tmp_path / "mine", tiny=False)
    goes_through(project, "survey=graded")
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


def test_the_choices_are_those_of_the_groups_that_may_be_chosen():
    assert GROUPS == ["collision", "fittings", "floors", "look", "preset", "rock", "survey"]
    tried = {choice for overrides in together() for choice in overrides.split()}
    assert tried | OF_THE_EMBEDDED_MINE.keys() | NEEDS.keys() == set(CHOICES)
    assert set(SMALLER) <= tried
