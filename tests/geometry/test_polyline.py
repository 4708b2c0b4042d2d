import numpy as np
import pytest

from pipeline.geometry.polyline import arc_length, resample


def test_the_arc_length_of_a_right_angled_path_is_the_sum_of_its_legs():
    assert arc_length(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])).tolist() == [0.0, 3.0, 7.0]


def test_the_arc_length_of_a_half_circle_is_pi_times_its_radius():
    angle = np.linspace(0, np.pi, 10_001)
    assert arc_length(2 * np.column_stack([np.cos(angle), np.sin(angle)]))[-1] == pytest.approx(2 * np.pi, rel=1e-6)


def test_a_single_point_has_no_length():
    assert arc_length(np.zeros((1, 3))).tolist() == [0.0]


def test_resampled_stations_are_evenly_spaced_and_keep_the_ends():
    chainage, points = resample(np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 5.0]]), 3.0)
    assert chainage.tolist() == pytest.approx(np.linspace(0, 15, 6).tolist())
    assert points[0].tolist() == [0, 0]
    assert points[-1].tolist() == [10, 5]
