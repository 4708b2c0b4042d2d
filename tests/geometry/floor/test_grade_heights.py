import numpy as np
import pytest

from pipeline.geometry.floor.grade_heights import heights_of_grades, misclosure_at

NAN = np.nan


def test_heights_of_a_tree_are_the_sums_of_its_rises():
    pairs, run = np.array([[0, 1], [1, 2], [3, 1]]), np.array([100.0, 50.0, 10.0])
    assert heights_of_grades(pairs, run, np.array([0.02, -0.1, 0.3])) == pytest.approx([0.0, 2.0, -3.0, -1.0])


def test_a_loop_that_misses_changes_every_grade_by_the_misclosure_over_its_length():
    pairs, run = np.array([[0, 1], [1, 2], [2, 0]]), np.array([100.0, 60.0, 40.0])
    grade = np.array([0.01, 0.02, -0.03])  # 1 m up, 1.2 m up, 1.2 m down: 1 m over
    z = heights_of_grades(pairs, run, grade)
    assert (z[pairs[:, 1]] - z[pairs[:, 0]]) / run == pytest.approx(grade - 1.0 / 200.0)
    for shot in range(3):
        assert misclosure_at(shot, pairs, run, grade) == pytest.approx(1.0)


def test_two_loops_that_share_a_leg_have_the_least_squares_of_their_normal_equations():
    pairs, run = np.array([[0, 1], [0, 1], [0, 1]]), np.array([10.0, 20.0, 40.0])
    grade = np.array([0.1, 0.08, 0.03])
    mean = np.average(grade * run, weights=1.0 / run)  # three ways between two stations
    assert heights_of_grades(pairs, run, grade) == pytest.approx([0.0, mean])
    assert misclosure_at(0, pairs, run, grade) == pytest.approx(1.0 - np.average([1.6, 1.2], weights=[1 / 20, 1 / 40]))


def test_a_leg_without_a_grade_is_linear_between_its_ends():
    # A graded way of 3 m up, and beside it a leg of three shots without a grade; a dead end without one is level.
    pairs = np.array([[0, 1], [0, 2], [2, 3], [3, 1], [3, 4]])
    run, grade = np.array([100.0, 20.0, 30.0, 50.0, 70.0]), np.array([0.03, NAN, NAN, NAN, NAN])
    assert heights_of_grades(pairs, run, grade) == pytest.approx([0.0, 3.0, 0.6, 1.5, 1.5])


def test_a_leg_without_a_grade_between_two_that_have_one_is_level():
    pairs = np.array([[0, 1], [1, 2], [2, 3]])
    assert heights_of_grades(pairs, np.array([10.0, 10.0, 10.0]), np.array([0.1, NAN, 0.2])) == pytest.approx(
        [0, 1, 1, 3]
    )


def test_heights_count_from_the_first_station_where_it_has_no_grade():
    pairs = np.array([[0, 1], [1, 2]])
    assert heights_of_grades(pairs, np.array([10.0, 10.0]), np.array([NAN, 0.1])) == pytest.approx([0.0, 0.0, 1.0])
