"""The stages of a world in one process."""

import json

import pytest

from pipeline import progress
from pipeline.build import world
from pipeline.build.world import make_world
from pipeline.errors import ArtifactError, GeometryError
from pipeline.stage import Artifact, Stage, is_fresh


def _stages(monkeypatch, second):
    """Give a world two stages, of which the second one reads what the first has written."""
    stages = [
        Stage(
            "survey",
            run=lambda params: {"one": {"first": 1}},
            reads={},
            writes={"one": Artifact("survey/one.json", dict)},
        ),
        Stage(
            "contours",
            run=second,
            reads={"one": Artifact("survey/one.json", dict)},
            writes={"two": Artifact("contours/two.json", dict)},
        ),
    ]
    monkeypatch.setattr(world, "load_stages", lambda: stages)
    return stages


def test_each_stage_gets_what_an_earlier_one_has_written_and_runs_once(monkeypatch, tmp_path, config):
    _stages(monkeypatch, lambda params, one: {"two": {**one, "second": 2}})
    assert make_world(config, tmp_path) == ["survey", "contours"]
    assert json.loads((tmp_path / "contours/two.json").read_text()) == {"first": 1, "second": 2}
    assert make_world(config, tmp_path) == []


def test_a_world_that_takes_long_shows_how_many_stages_are_done(monkeypatch, tmp_path, config, capfd):
    monkeypatch.setattr(progress, "AFTER_S", 0.0)
    monkeypatch.setattr(progress, "_EVERY_S", 0.0)
    _stages(monkeypatch, lambda params, one: {"two": one})
    make_world(config, tmp_path / "mine")
    assert "mine: 2 of 2 stages, 00:00 left" in capfd.readouterr().err


def test_what_ran_before_a_stage_failed_is_kept_and_the_next_command_continues_from_there(
    monkeypatch, tmp_path, config
):
    def second(params, one):
        raise GeometryError("contours: no outline")

    survey, contours = _stages(monkeypatch, second)
    with pytest.raises(GeometryError, match="no outline"):
        make_world(config, tmp_path)
    assert is_fresh(survey, config.survey, tmp_path)
    assert not is_fresh(contours, config.contours, tmp_path)
    _stages(monkeypatch, lambda params, one: {"two": one})
    assert make_world(config, tmp_path) == ["contours"]


def test_a_stage_writes_all_that_it_declares_or_nothing(monkeypatch, tmp_path, config):
    _stages(monkeypatch, lambda params, one: {})
    with pytest.raises(ArtifactError, match=r"contours: wrote \[\], declares \['two'\]"):
        make_world(config, tmp_path)
    assert not (tmp_path / "contours").exists()
