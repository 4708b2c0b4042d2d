"""The stages of a world in one process."""

import json
import os
import sys

import pytest

from pipeline.build import world
from pipeline.build.world import make_world
from pipeline.errors import ArtifactError, GeometryError
from pipeline.guard.forked import Forked
from pipeline.stage import LATER, Artifact, Stage, is_fresh, make_artifacts

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="work is begun in forked processes there")


def _stages(monkeypatch, first, begun):
    """Let a world have two stages: the first one calls a function, the second one begins early."""

    def begin(params, root):
        begun.append(Forked(lambda: str(root)))
        return begun[-1]

    stages = [
        Stage("survey", run=first, reads={}, writes={"one": Artifact("survey/one.json", dict)}),
        Stage(
            "contours",
            run=lambda params, one, begun: {"two": {**one, "begun": begun.result()}},
            reads={"one": Artifact("survey/one.json", dict)},
            writes={"two": Artifact("contours/two.json", dict)},
            begin=begin,
            begins_with="survey",
        ),
    ]
    monkeypatch.setattr(world, "load_stages", lambda: stages)


def test_a_stage_begins_while_the_one_before_runs_and_gets_what_it_began(monkeypatch, tmp_path, config):
    begun, seen = [], []

    def first(params):
        seen.append(len(begun))
        return {"one": {"first": 1}}

    _stages(monkeypatch, first, begun)
    assert make_world(config, tmp_path) == ["survey", "contours"]
    assert seen == [1]
    assert json.loads((tmp_path / "contours/two.json").read_text()) == {"first": 1, "begun": str(tmp_path)}
    assert make_world(config, tmp_path) == []
    assert len(begun) == 1  # nothing is begun for a stage that is up to date


def test_what_a_stage_began_ends_if_the_one_before_fails(monkeypatch, tmp_path, config):
    begun = []

    def first(params):
        raise GeometryError("survey: no plan")

    _stages(monkeypatch, first, begun)
    with pytest.raises(GeometryError, match="no plan"):
        make_world(config, tmp_path)
    assert not begun[0]._process.is_alive()


def _with_later(monkeypatch, later, second):
    """Give a world two stages; a forked process of the first makes its file `seen`, which is written later."""
    stages = [
        Stage(
            "survey",
            run=lambda params: {"one": {"first": 1}, LATER: Forked(later)},
            reads={},
            writes={"one": Artifact("survey/one.json", dict), "seen": Artifact("survey/seen.json", dict)},
        ),
        Stage(
            "contours",
            run=second,
            reads={"one": Artifact("survey/one.json", dict)},
            writes={"two": Artifact("contours/two.json", dict)},
        ),
    ]
    monkeypatch.setattr(world, "load_stages", lambda: stages)
    return stages[0]


def test_a_stage_runs_before_the_one_before_has_written_what_comes_later(monkeypatch, tmp_path, config):
    reading, writing = os.pipe()
    survey, seen = tmp_path / "survey", []

    def second(params, one):
        seen.extend(path.name for path in survey.iterdir())
        os.write(writing, b"go")
        return {"two": one}

    stage = _with_later(monkeypatch, lambda: {"seen": {"go": os.read(reading, 2).decode()}}, second)
    assert make_world(config, tmp_path) == ["survey", "contours"]
    assert sorted(seen) == ["manifest.json", "one.json"]
    assert json.loads((survey / "seen.json").read_text()) == {"go": "go"}
    assert json.loads((tmp_path / "contours/two.json").read_text()) == {"first": 1}
    assert is_fresh(stage, config.survey, tmp_path)
    apart = tmp_path / "apart"
    os.write(writing, b"go")
    make_artifacts(stage, config.survey, apart)  # as DVC runs it: all at once
    names = sorted(path.name for path in survey.iterdir())
    assert names == sorted(path.name for path in (apart / "survey").iterdir())
    assert all((survey / name).read_bytes() == (apart / "survey" / name).read_bytes() for name in names[1:])


def test_what_fails_later_is_an_error_of_its_stage_which_then_runs_again(monkeypatch, tmp_path, config):
    def later():
        raise GeometryError("survey: faces cross")

    def second(params, one):
        raise GeometryError("contours: no outline")

    stage = _with_later(monkeypatch, later, lambda params, one: {"two": one})
    with pytest.raises(GeometryError, match="faces cross"):
        make_world(config, tmp_path)
    assert not is_fresh(stage, config.survey, tmp_path)
    other = tmp_path / "other"
    _with_later(monkeypatch, later, second)
    with pytest.raises(GeometryError, match="faces cross"):  # of two, the earlier stage's
        make_world(config, other)
    stage = _with_later(monkeypatch, lambda: {"seen": {}}, second)
    with pytest.raises(GeometryError, match="no outline"):
        make_world(config, other)
    assert is_fresh(stage, config.survey, other)  # and the next command continues from there


def test_what_comes_later_is_all_that_is_declared(monkeypatch, tmp_path, config):
    stage = _with_later(monkeypatch, dict, lambda params, one: {"two": one})
    for run in (lambda: make_world(config, tmp_path), lambda: make_artifacts(stage, config.survey, tmp_path)):
        with pytest.raises(ArtifactError, match=r"survey: wrote \['one'\], declares \['one', 'seen'\]"):
            run()
