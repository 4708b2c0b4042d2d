"""Every choice of every group in conf/ goes through the whole pipeline, as by `make all OVERRIDES=...`."""

import json
from itertools import zip_longest

import pytest

from pipeline.places import CONF
from stages.__main__ import STAGES
from tests.project import ROOT, Project

NOT_THE_PIPELINES = {"train"}  # the baselines' configuration
NEEDS = {"survey=plan": "the fetched plan", "survey=variant": "another mine's workings"}  # see the tests of these
OF_THE_EMBEDDED_MINE = {"preset=paper": "states its scale", "survey=graded": "states grades of its legs"}
CHOICES = sorted(
    f"{path.parent.name}={path.stem}"
    for path in (ROOT / CONF).glob("*/*.yaml")
    if path.parent.name not in {*STAGES[1:], "mine", *NOT_THE_PIPELINES}
)
GROUPS = sorted({choice.partition("=")[0] for choice in CHOICES})


def together() -> list[str]:
    """Return overrides that have each choice once: those of different groups go together, a preset goes alone."""
    free = [choice for choice in CHOICES if choice not in {*NEEDS, *OF_THE_EMBEDDED_MINE}]
    of_group = [[c for c in free if c.startswith(f"{group}=")] for group in GROUPS if group != "preset"]
    rounds = [" ".join(filter(None, choices)) for choices in zip_longest(*of_group)]
    return rounds + [choice for choice in free if choice.startswith("preset=")]


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
    goes_through(repro.copy(tmp_path / "mine"), overrides)


@pytest.mark.slow
@pytest.mark.parametrize("choice", OF_THE_EMBEDDED_MINE)
def test_a_choice_of_the_embedded_mine_goes_through_make_all(tmp_path, choice):
    goes_through(Project(tmp_path / "mine", tiny=False), choice)


def test_the_choices_are_those_of_the_groups_that_may_be_chosen():
    assert GROUPS == ["collision", "fittings", "floors", "look", "preset", "rock", "survey"]
    tried = {choice for overrides in together() for choice in overrides.split()}
    assert tried | OF_THE_EMBEDDED_MINE.keys() | NEEDS.keys() == set(CHOICES)
