"""What the comparison with other packages measures, on worlds with known answers."""

import mujoco
import numpy as np
import pytest
import shapely

from benchmarks.comparisons.peers import PeerRow, blocked_share, free_points, maze_of

DRIFT = shapely.box(0, 0, 40, 6)


def test_a_ball_is_blocked_where_a_box_stands_and_not_beside_it():
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[1, 1, 1])
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[1, 1, 1], pos=[5, 0, 0], contype=0, conaffinity=0)
    places = np.array([[0.5, 0, 0], [1.5, 0, 0], [5, 0, 0], [0, 0, -0.9]])
    assert blocked_share(spec, places, 1) == 0.5


def test_points_are_free_of_walls_by_more_than_the_ball():
    points = free_points(DRIFT, np.random.default_rng(0))
    assert len(points) == 5000
    assert shapely.contains_xy(DRIFT.buffer(-0.01), points).all()
    assert points[:, 0].mean() == pytest.approx(20, abs=0.5)


def test_a_maze_is_free_where_the_plan_is_and_walled_all_round():
    maze, centre = maze_of(DRIFT)
    walls = np.array([[cell == 1 for cell in row] for row in maze])
    assert walls.shape == (5, 22)
    assert not walls[1:-1, 1:-1].any()
    assert walls[[0, -1]].all()
    assert walls[:, [0, -1]].all()
    assert sum(row.count("r") for row in maze) == 1
    assert tuple(centre) == (20, 3)


def test_a_row_shows_what_was_measured_by_the_kilometre_and_a_dash_for_the_rest():
    row = PeerRow("a", "b", make_s=3.0, size=2_000_000, blocked=0.0, steps_per_s=1234.0)
    assert row.cells(2.0) == ["a", "1.50", "1.000", "0.00%", "-", "1,234", "-", "b"]
