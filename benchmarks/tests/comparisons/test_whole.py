"""The gate of one model: its rows, its turns, and stages that are run and timed in a copy of the project."""

import pytest

from benchmarks.comparisons.one_model.gate import (
    NONE,
    ROWS,
    GateRow,
    at_least_times,
    at_most,
    clause_rows,
    row_of,
    within_spread,
)
from benchmarks.comparisons.one_model.whole import MODELS, Whole, _keep, _kept, build, in_turn, medians
from benchmarks.speed.time_pipeline import StageRun
from pipeline.compose import compose
from pipeline.errors import MineError
from tests.project import Project


def cells(wanted, level, volume):
    row = GateRow("figure", "a", "b", wanted, ".1f")
    return row_of(row, {"a": level, "texture.spread.strict": 0.5}, {"b": volume}, {"a": 7.0})


def test_a_row_has_both_figures_their_ratio_and_whether_what_is_wanted_holds():
    assert cells(at_most(3), 2.0, 3.0) == ("figure", "at most 3", "2.0", "3.0", "1.50", "yes", "7.0")
    assert cells(at_most(3), 2.0, 3.1)[5] == "**no**"
    assert cells(at_least_times(0.95), 100.0, 95.0)[5] == "yes"
    assert cells(at_least_times(0.95), 100.0, 94.0)[5] == "**no**"
    assert cells(within_spread("strict"), 8.0, 7.5)[5] == "yes"
    assert cells(within_spread("strict"), 8.0, 7.4)[5] == "**no**"
    assert cells(None, 0.0, 3.0)[4:6] == ("", "")


def test_a_figure_that_a_model_does_not_have_is_named_and_is_not_met():
    row = GateRow("figure", "a", "b", at_most(3))
    assert row_of(row, {"a": 1.0}, {}, {}) == ("figure", "at most 3", "1", NONE, "", NONE, NONE)


def test_rows_have_titles_of_their_own():
    titles = [row.title for row in ROWS]
    assert len(set(titles)) == len(titles)


def test_clauses_have_limit_value_and_whether_they_hold():
    clauses = {"gap_mm": {"value": 12.0, "limit": {"max": 10.0}, "holds": False}}
    assert clause_rows("volume", clauses) == [("volume", "gap_mm", "<= 10", "12", "**no**")]


def test_models_take_turns_and_times_are_medians_but_memory_is_the_largest():
    assert [in_turn(("A", "B"), turn) for turn in range(3)] == [("A", "B"), ("B", "A"), ("A", "B")]
    runs = [{"wall_s.all": s, "peak_mb": mb} for s, mb in ((5.0, 10.0), (1.0, 30.0), (2.0, 20.0))]
    assert medians(runs) == {"wall_s.all": 2.0, "peak_mb": 30.0}


def test_the_overrides_make_a_level_plan_and_a_volume_of_the_same_survey():
    level, volume = (compose(list(MODELS[name])) for name in ("level", "volume"))
    assert level.survey.grade is None
    assert volume.survey.grade == 0.0
    assert level.realism.tilt_deg == volume.realism.tilt_deg == 0.0


def test_builds_that_a_folder_keeps_are_read_back(tmp_path):
    builds = [Whole({"survey": StageRun(2.0, 1.5, 300.0), "contours": StageRun(1.0, 0.5, 400.0)}, "beyond a limit")]
    assert _kept(tmp_path) == []
    _keep(tmp_path, builds)
    assert _kept(tmp_path) == builds
    assert builds[0].figures["wall_s.all"] == 3.0
    assert builds[0].figures["peak_mb"] == 400.0


@pytest.mark.slow
def test_stages_are_timed_and_one_that_fails_says_why(tmp_path):
    project = Project(tmp_path / "project", tiny=True)
    found = build(project, MODELS["volume"], ("survey", "contours")).figures
    assert found["processor_s.all"] == pytest.approx(found["processor_s.survey"] + found["processor_s.contours"])
    assert found["processor_s.survey"] > 0
    assert found["peak_mb"] > 50
    with pytest.raises(MineError, match="no_such"):
        build(project, ("survey.no_such=1",), ("survey",))
