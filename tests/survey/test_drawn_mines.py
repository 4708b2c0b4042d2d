"""Generated mines as pictures: stage 2 traces them as it traces a user's plan."""

import numpy as np
import pytest

from pipeline.metrics.wall_error import signed_distances
from pipeline.store.mine_survey import WORKINGS
from pipeline.survey.load import read_survey
from stages.contours import trace_free_space
from tests.composed import compose
from tests.project import ROOT

ROUGH = "survey.rough_walls={rms_m: 0.06, hurst: 0.75, shortest_m: 0.3, longest_m: 6.0}"
MINE = ["survey=procedural", "survey.seed=4", "survey.mine.size_m=[50,60]", "survey.mine.width_m=[2.5,3.5]", ROUGH]


@pytest.fixture(autouse=True)
def _in_the_project(monkeypatch):
    monkeypatch.chdir(ROOT)


@pytest.mark.parametrize("drawn", [[], ["survey.anti_aliased=false"], ["survey.jpeg_quality=80"]], ids=len)
def test_the_walls_of_a_drawn_rough_mine_are_built_within_the_wall_error_of_the_true_ones(drawn):
    (truth,) = read_survey(compose(MINE).survey).workings.polygons.geoms
    config = compose([*MINE, "survey.as_picture=true", "survey.px_per_m=10", *drawn])
    read = read_survey(config.survey)
    assert read.workings is None
    built = trace_free_space(config.contours, read)
    traced, polygon = built["traced"][WORKINGS].polygons.geoms[0], built["free_space"].polygon
    assert len(polygon.interiors) == len(truth.interiors)
    assert np.abs(signed_distances(traced, polygon)).mean() <= 0.031
    assert np.abs(signed_distances(truth, polygon)).mean() <= 0.045  # cleaning rounds notches too


def test_a_pixel_outline_is_farther_from_the_true_walls_than_the_half_level():
    (truth,) = read_survey(compose(MINE).survey).workings.polygons.geoms
    config = compose([*MINE, "survey.as_picture=true", "survey.px_per_m=10"])
    read = read_survey(config.survey)
    errors = []
    for trace in ("pixels", "half_level"):
        params = config.contours.model_copy(update={"trace": trace})
        traced = trace_free_space(params, read)["traced"][WORKINGS].polygons.geoms[0]
        errors.append(np.abs(signed_distances(truth, traced)).mean())
    assert errors[1] < 0.7 * errors[0]


def test_a_wall_error_that_would_close_a_drift_is_halved():
    config = compose([*MINE, "contours.wall_error_m=0.5"])
    read = read_survey(config.survey)
    built = trace_free_space(config.contours, read)
    traced, polygon = built["traced"][WORKINGS].polygons.geoms[0], built["free_space"].polygon
    assert len(polygon.interiors) == len(traced.interiors)
    assert np.abs(signed_distances(traced, polygon)).mean() <= 0.5


@pytest.mark.slow
def test_no_wall_moves_by_more_than_eight_times_the_wall_error():
    config = compose(["survey=procedural", "survey.mine.style=drift_and_crosscut", "survey.seed=5"])
    read = read_survey(config.survey)
    built = trace_free_space(config.contours, read)["free_space"]
    assert built.tolerance_m <= 8 * config.contours.wall_error_m  # the first fit of this mine moves a wall by 0.26 m
