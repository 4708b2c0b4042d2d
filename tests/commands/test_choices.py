"""Every choice of every group in conf/ goes through the whole pipeline, as by `make all OVERRIDES=...`."""

import json

import pytest

from pipeline.places import CONF
from stages.__main__ import STAGES
from tests.project import ROOT, Project

NOT_THE_PIPELINES = {"train"}  # the baselines' configuration
NEEDS = {"survey=plan": "the fetched plan", "survey=variant": "another mine's workings"}  # see the tests of these
CHOICES = sorted(
    f"{path.parent.name}={path.stem}"
    for path in (ROOT / CONF).glob("*/*.yaml")
    if path.parent.name not in {*STAGES[1:], "mine", *NOT_THE_PIPELINES}
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a project with the embedded survey; a choice reruns only the stages that it changes."""
    project = Project(tmp_path_factory.mktemp("choices") / "mine", tiny=False)
    (project.folder / "requirements" / "setup.sh").write_text("exit 0\n")  # the copy uses the tests' environment
    return project


@pytest.mark.slow
@pytest.mark.parametrize("choice", [choice for choice in CHOICES if choice not in NEEDS])
def test_every_choice_goes_through_make_all(whole, choice):
    done = whole.run("make", "all", OVERRIDES=choice)
    assert done.returncode == 0, done.stderr
    artifacts = whole.folder / "artifacts"
    assert (
        json.loads((artifacts / "validation/certificate.json").read_text())["world_sha256"]
        in (artifacts / "report/report.html").read_text()
    )


def test_the_choices_are_those_of_the_groups_that_may_be_chosen():
    groups = {choice.partition("=")[0] for choice in CHOICES}
    assert groups == {"collision", "fittings", "floors", "look", "preset", "rock", "survey"}
