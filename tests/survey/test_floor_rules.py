"""The values by which a survey becomes floors are parameters of stage 1."""

import pytest
import yaml

from minesurveys.limits import FILE
from pipeline.compose import compose  # of another project than this checkout
from pipeline.errors import ParamsError
from pipeline.params.floor_rules import FloorRules
from pipeline.params.survey import PassageSurveyParams
from pipeline.stage import ARTIFACTS, is_fresh
from pipeline.store.mine_survey import MineModel
from pipeline.survey.load import read_survey
from stages.survey import STAGE
from tests.project import ROOT

STEEP = """leg,station,easting_m,northing_m,elevation_m,left_m,right_m
A,a0,0,0,0,2,2
A,a1,20,0,4,2,2
A,a2,40,0,8,2,2
"""


def test_a_changed_rule_makes_stage_1_stale(traced_project, monkeypatch):
    monkeypatch.chdir(traced_project.folder)
    as_built = compose([]).survey
    assert is_fresh(STAGE, as_built, ARTIFACTS)
    for rule in FloorRules.model_fields:
        changed = compose([f"survey.{rule}={getattr(as_built, rule) / 2}"]).survey
        assert not is_fresh(STAGE, changed, ARTIFACTS), rule
    stages = yaml.load((ROOT / "dvc.yaml").read_text(), yaml.CSafeLoader)["stages"]
    assert {"artifacts/params.json": ["survey"]} in stages["survey"]["params"]  # DVC compares this section


def test_no_rule_is_left_among_the_limits_of_readers_on_which_no_stage_depends():
    assert not set(yaml.safe_load((ROOT / FILE).read_text())) & set(FloorRules.model_fields)


def test_the_configuration_has_the_defaults_of_the_schema(monkeypatch):
    monkeypatch.chdir(ROOT)
    survey = compose([]).survey
    assert {name: getattr(survey, name) for name in FloorRules.model_fields} == FloorRules().model_dump()


@pytest.mark.parametrize("value", ["steepest_grade=0", "steepest_grade=1.1", "grade_change=0.2", "flat_step_m=-1"])
def test_a_rule_out_of_bounds_is_refused(monkeypatch, value):
    monkeypatch.chdir(ROOT)
    key, _, number = value.partition("=")
    with pytest.raises(ParamsError, match=rf"^survey\.{key} = {number}: "):
        compose([f"survey.{value}"])


def test_a_survey_is_read_by_its_own_rules(tmp_path, monkeypatch):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "steep.csv").write_text(STEEP)
    (tmp_path / "data" / "registry.txt").write_text("")
    monkeypatch.chdir(tmp_path)
    section = {"kind": "passages", "name": "steep", "file": "data/steep.csv"}
    assert read_survey(PassageSurveyParams.model_validate(section)).model is MineModel.VOLUME
    level = PassageSurveyParams.model_validate({**section, "flat_step_m": 10})
    assert read_survey(level).model is MineModel.LEVEL
