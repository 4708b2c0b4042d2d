"""Sweeps take off the bias in width that a plan has, and walls follow them."""

import numpy as np
import pytest
import shapely

from pipeline.errors import GeometryError
from pipeline.scans.correct import Sweeps, correct_by_sweeps, mean_bias
from pipeline.scans.sweep_correction import cast_fan, caster_of, follow_sweeps, narrow_drifts
from tests.mines import TEE

DRIFT = shapely.box(0, 0, 60, 5)
POSE = (30.0, 2.5, 0.3)


def sweep_in(free, pose, count=720):
    bearing = np.linspace(-np.pi, np.pi, count, endpoint=False)
    ranges = cast_fan(caster_of(free), pose, bearing)
    return bearing[ranges < 9.0], ranges[ranges < 9.0]


def test_a_narrowed_drift_loses_the_distance_on_every_side():
    narrowed = narrow_drifts(shapely.box(-1, -1, 61, 6), 1.0)
    assert narrowed.bounds == pytest.approx((0, 0, 60, 5), abs=1e-9)
    assert DRIFT.area - narrowed.area == pytest.approx(4 * (1 - np.pi / 4) * 0.75**2, abs=0.05)  # rounded corners


def test_a_drift_that_would_close_is_refused_with_the_width():
    with pytest.raises(GeometryError, match=r"no drift is wider than 5\.20 m, the bias in width"):
        narrow_drifts(DRIFT, 2.6)
    hourglass = shapely.union_all([shapely.box(0, 0, 20, 8), shapely.box(20, 3, 30, 5), shapely.box(30, 0, 50, 8)])
    with pytest.raises(GeometryError, match="that much of the plan would be cut off"):
        narrow_drifts(hourglass, 1.1)


def test_walls_that_a_sweep_sees_lie_on_its_returns_and_others_stay():
    plan = shapely.box(0, -0.4, 60, 5.3)
    followed, length = follow_sweeps(plan, {"a": sweep_in(DRIFT, POSE)}, {"a": POSE})
    seen = followed.intersection(shapely.box(25, -2, 35, 8))
    assert seen.symmetric_difference(shapely.box(25, 0, 35, 5)).area < 0.02 * 2 * 10
    far = followed.intersection(shapely.box(45, -2, 60, 8))
    assert far.symmetric_difference(shapely.box(45, -0.4, 60, 5.3)).area < 0.02
    assert 24 < length["a"] < 4 * np.sqrt(9**2 - 2.5**2)  # grazing returns lie too far apart


def test_a_vehicle_in_a_drift_is_not_followed():
    with_vehicle = DRIFT.difference(shapely.box(33, 1.5, 36, 3.5))
    followed, _ = follow_sweeps(DRIFT, {"a": sweep_in(with_vehicle, POSE)}, {"a": POSE})
    assert DRIFT.area - followed.area < 0.2


def test_the_interval_is_the_range_of_means_with_each_sweep_left_out():
    assert mean_bias({"a": 0.9, "b": 1.0, "c": 1.4}) == (1.1, (0.95, 1.2))


def test_sweeps_that_disagree_on_the_sign_support_no_correction():
    with pytest.raises(GeometryError, match=r"disagree on whether .* too wide .a .0\.30 m, b -0\.20 m"):
        mean_bias({"a": 0.3, "b": -0.2})


@pytest.mark.slow
def test_a_plan_drawn_too_wide_is_corrected_to_the_true_walls():
    truth, plan = TEE, TEE.buffer(0.8, join_style="mitre")
    poses = {"a": (20.0, 2.0, 0.0), "b": (38.0, 3.0, 1.0)}
    fans = {name: sweep_in(truth, pose) for name, pose in poses.items()}
    correction = correct_by_sweeps(plan, Sweeps(poses, fans, fans))
    assert correction.report.bias_m == pytest.approx(0.8, abs=0.06)
    both = correction.polygon.intersection(truth).area / correction.polygon.union(truth).area
    assert both > 0.97
