import numpy as np
import pytest
import shapely
import yaml

from pipeline.errors import GeometryError
from pipeline.geometry.occupancy import entrance_anchor, nav2_map, occupancy_grid, sample_poses
from tests.mines import RING, STRAIGHT, TEE

WORLD = (-4.0, -4.0, 104.0, 9.0)


def test_clearance_in_a_straight_drift_is_the_distance_to_the_nearer_wall():
    grid = occupancy_grid(STRAIGHT, 0.5, WORLD)
    row = int((2.25 - grid.origin_m[1]) / 0.5)
    col = int((50.25 - grid.origin_m[0]) / 0.5)
    assert grid.clearance_m[row, col] == pytest.approx(2.25)
    assert grid.free.sum() * 0.25 == pytest.approx(STRAIGHT.area)
    assert not grid.clearance_m[~grid.free].any()


@pytest.mark.parametrize("clearance", [0.3, 1.0, 2.4])
def test_sampled_poses_keep_their_clearance_exactly(clearance):
    grid = occupancy_grid(TEE, 0.25, (-4.0, -4.0, 84.0, 44.0))
    poses = sample_poses(grid, 2000, clearance, np.random.default_rng(0))
    points = shapely.points(poses[:, :2])
    assert shapely.contains(TEE, points).all()
    assert shapely.distance(points, TEE.boundary).min() >= clearance
    assert poses[:, 2].min() >= -np.pi
    assert poses[:, 2].max() < np.pi


def test_the_same_seed_gives_the_same_poses_and_another_seed_others():
    grid = occupancy_grid(RING, 0.5, (-4.0, -4.0, 64.0, 44.0))
    one, same, other = (sample_poses(grid, 50, 0.5, np.random.default_rng(s)) for s in (1, 1, 2))
    assert (one == same).all()
    assert not (one == other).all()


def test_poses_can_be_asked_for_near_a_place():
    grid = occupancy_grid(RING, 0.25, (-4.0, -4.0, 64.0, 44.0))
    poses = sample_poses(grid, 500, 0.5, np.random.default_rng(0), centre_m=(3.0, 3.0), radius_m=5.0)
    assert np.linalg.norm(poses[:, :2] - [3, 3], axis=1).max() <= 5.0 + 0.25


def test_a_clearance_nobody_offers_is_refused_with_the_widest():
    grid = occupancy_grid(STRAIGHT, 0.5, WORLD)
    with pytest.raises(GeometryError, match=r"2\.25 m"):
        sample_poses(grid, 1, 3.0, np.random.default_rng(0))


def test_no_clearance_is_still_no_rock_and_less_than_none_is_refused():
    grid = occupancy_grid(TEE, 0.25, (-4.0, -4.0, 84.0, 44.0))
    poses = sample_poses(grid, 500, 0.0, np.random.default_rng(0))
    assert shapely.contains(TEE, shapely.points(poses[:, :2])).all()
    with pytest.raises(GeometryError, match="-1 is negative"):
        sample_poses(grid, 5, -1.0, np.random.default_rng(0))


def test_the_anchor_is_the_roomiest_place_near_the_entrance():
    grid = occupancy_grid(TEE, 0.25, (-4.0, -4.0, 84.0, 44.0))
    spawn = entrance_anchor(grid, (40.5, 2.5), 15.0, 0.5)
    # In the junction's throat the nearest rock is the far wall or a corner: more room than mid-drift.
    assert spawn.anchor_clearance_m > 2.5
    with pytest.raises(GeometryError, match=r"move survey\.entrance_m"):
        entrance_anchor(grid, (0.0, 44.0), 3.0, 0.5)


def test_the_nav2_map_says_what_the_grid_says():
    grid = occupancy_grid(TEE, 0.5, (-4.0, -4.0, 84.0, 44.0))
    image, text = nav2_map(grid)
    meta = yaml.safe_load(text)
    assert ((image == 254)[::-1] == grid.free).all()
    assert meta["resolution"] == 0.5
    assert meta["origin"] == [grid.origin_m[0], grid.origin_m[1], 0.0]
    assert "/" not in meta["image"]
