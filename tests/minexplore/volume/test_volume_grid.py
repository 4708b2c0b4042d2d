"""Which floors of a volume a robot reaches, and which cells its beams mark."""

import numpy as np
import pytest

from minexplore.floors.volume_arrays import FloorSpans
from minexplore.physics.robot import RobotParams
from minexplore.sensing.coverage import mark
from minexplore.volume.cells import VolumeGrid
from minexplore.volume.standing import standing_spans

CELL_M = 0.25
ROBOT = RobotParams()


def spans(rows):
    """Return spans of (column, row, floor, headroom), wide enough everywhere."""
    column, row, floor, headroom = np.array(rows, float).T
    whole = np.int32
    wide, storey = np.full(len(floor), 1.0), np.zeros(len(floor), whole)
    room = np.zeros((len(floor), 3), np.float32), np.ones((len(floor), 4), np.float32)
    return FloorSpans(
        column.astype(whole), row.astype(whole), floor, headroom, wide, storey, *room, np.zeros(2), CELL_M
    )


def strip(floors, headroom=3.0, first=0):
    """Return the rows of a drift along x with these floors."""
    return [(first + k, 0, floor, headroom) for k, floor in enumerate(floors)]


def reached(rows, anchor=(0.0, 0.0, 0.0)):
    return standing_spans(spans(rows), ROBOT, np.array(anchor))


def test_a_robot_reaches_what_is_no_steeper_than_it_climbs():
    climbs = reached(strip(np.arange(20) * 0.09))  # 0.36 of rise over run
    assert climbs.all()
    assert reached(strip(np.arange(20) * 0.16)).sum() == 1


def test_a_step_higher_than_a_castor_ends_a_robots_way():
    assert reached(strip([0.0] * 10 + [0.13] * 10)).all()
    assert reached(strip([0.0] * 10 + [0.2] * 10)).sum() == 10


def test_a_roof_under_the_scanner_and_a_narrow_place_end_a_robots_way():
    low = strip([0.0] * 10) + strip([0.0] * 5, 0.6, 10) + strip([0.0] * 5, 3.0, 15)
    assert reached(low).sum() == 10
    narrow = spans(strip([0.0] * 20))
    narrow.clearance_m[12] = 0.3
    assert standing_spans(narrow, ROBOT, np.zeros(3)).sum() == 12


def test_two_floors_under_one_roof_line_do_not_join_where_no_robot_fits_between_them():
    rows = [(0, 0, 0.0, 0.7), (1, 0, 0.1, 0.7)]  # from 0.1 to 0.7 there are 0.6 m
    assert reached(rows).sum() == 1


def test_floors_over_each_other_are_reached_one_by_one_and_are_two_cells():
    lower, upper = strip([0.0] * 24), strip([4.0] * 24)
    both = spans(lower + upper)
    standing = standing_spans(both, ROBOT, np.array([1.0, 0.1, 4.0]))
    assert standing[24:].all()
    assert not standing[:24].any()
    grid = VolumeGrid(both, np.ones(48, bool), 2.0)
    assert grid.total == 6
    assert len(np.unique(grid.square)) == 3


def test_a_robot_that_fits_nowhere_is_an_error():
    with pytest.raises(ValueError, match="no place where the robot fits"):
        reached(strip([0.0] * 5, 0.5))


def test_a_beam_marks_the_cells_whose_floor_is_the_next_under_it():
    grid = VolumeGrid(spans(strip([0.0] * 24) + strip([4.0] * 24)), np.ones(48, bool), 2.0)
    start, end = np.array([[0.5, 0.1, 4.5], [0.5, 0.1, 0.5], [0.5, 0.1, 9.0]]), np.array([[5.5, 0.1, 4.5]] * 3)
    end[:, 2] = start[:, 2]
    ray, cell = grid.cells_crossed(start, end, 10.0)
    assert grid.low_m[cell[ray == 0]] == pytest.approx([3.7] * 3)
    assert grid.low_m[cell[ray == 1]] == pytest.approx([-0.3] * 3)
    assert not (ray == 2).any()  # over the upper roof


def test_a_sloping_beam_marks_cells_of_both_floors_of_a_shaft():
    grid = VolumeGrid(spans(strip([0.0] * 24, 7.0) + strip([4.0] * 8)), np.ones(32, bool), 2.0)
    ray, cell = grid.cells_crossed(np.array([[0.5, 0.1, 4.5]]), np.array([[5.5, 0.1, 0.5]]), 10.0)
    assert grid.low_m[cell].round(6).tolist() == [3.7, -0.3, -0.3]
    assert (ray == 0).all()


def test_beams_that_start_at_one_place_mark_what_they_mark_one_by_one():
    grid = VolumeGrid(spans(strip([0.0] * 24, 7.0) + strip([4.0] * 8)), np.ones(32, bool), 2.0)
    start = np.array([[0.5, 0.1, 4.5]])
    ends = start + np.random.default_rng(0).uniform([-1, -1, -5], [6, 1, 2], (40, 3))
    together = grid.cells_crossed(start, ends, 10.0)
    np.testing.assert_array_equal(together, grid.cells_crossed(start.repeat(40, axis=0), ends, 10.0))
    assert len(together[0]) > 40


def test_marked_cells_count_once():
    grid = VolumeGrid(spans(strip([0.0] * 24)), np.ones(24, bool), 2.0)
    seen = np.zeros((2, *grid.reachable.shape), bool)
    new = mark(grid, seen, np.array([0, 0, 1]), np.array([1, 1, 2]))
    assert new.tolist() == [1, 1]
    assert mark(grid, seen, np.array([0]), np.array([1])).tolist() == [0, 0]
    assert grid.in_plan(seen[0]).tolist() == [[False, True, False]]
    assert seen.sum(axis=1).tolist() == [1, 1]


def test_a_fast_robot_cuts_grid_lines_as_the_plan_does():
    rng = np.random.default_rng(0)
    rows = [(x, y, 0.0, 3.0) for x in range(80) for y in range(80)]
    grid = VolumeGrid(spans(rows), np.ones(len(rows), bool), 2.0)
    start = np.column_stack([rng.uniform(2, 18, (50, 2)), np.full(50, 0.5)])
    end = start + np.column_stack([rng.uniform(-2, 2, (50, 2)), np.zeros(50)])
    ray, cell = grid.cells_crossed(start, end, 10.0)
    fine = np.linspace(0, 1, 2001)[:, None]
    for k in range(50):
        at = np.floor((start[k] + fine * (end[k] - start[k]))[:, :2] / 2.0).astype(int)
        crossed = {int(grid._first[y * grid.shape[1] + x]) for x, y in at.tolist()}
        assert crossed == set(cell[ray == k].tolist())
