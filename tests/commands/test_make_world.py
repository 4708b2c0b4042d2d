"""The stages of a world in one process."""

import json
import sys

import pytest

from pipeline.build import world
from pipeline.build.world import make_world
from pipeline.errors import GeometryError
from pipeline.guard.forked import Forked
from pipeline.stage import Artifact, Stage

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
