from dataclasses import replace

import numpy as np
import pytest
import yaml

from minesurveys.remarks import collect_remarks
from minexplore.sealed.sizes import MOST_CELLS
from pipeline.errors import GeometryError
from pipeline.geometry.maps.occupancy import cell_within_bundle, entrance_anchor, nav2_map, occupancy_grid
from tests.mines import STRAIGHT, TEE

WORLD = (-4.0, -4.0, 104.0, 9.0)


def test_clearance_in_a_straight_drift_is_the_distance_to_the_nearer_wall():
    grid = occupancy_grid(STRAIGHT, 0.5, WORLD)
    row = int((2.25 - grid.origin_m[1]) / 0.5)
    col = int((50.25 - grid.origin_m[0]) / 0.5)
    assert grid.clearance_m[row, col] == pytest.approx(2.25)
    assert grid.free.sum() * 0.25 == pytest.approx(STRAIGHT.area)
    assert not grid.clearance_m[~grid.free].any()


def test_the_anchor_is_the_place_with_the_largest_clearance_near_the_entrance():
    grid = occupancy_grid(TEE, 0.25, (-4.0, -4.0, 84.0, 44.0))
    spawn = entrance_anchor(grid, (40.5, 2.5), 15.0, 0.5)
    # In the junction the nearest rock is the far wall or a corner, farther than the walls of a drift.
    assert spawn.anchor_clearance_m > 2.5
    with pytest.raises(GeometryError, match=r"--start \(survey\.entrance_m\) moves the entrance"):
        entrance_anchor(grid, (0.0, 44.0), 3.0, 0.5)


def test_the_anchor_is_not_in_the_last_cells_beside_an_edge():
    """Where the distance from rock does not fall towards the edge of the grid."""
    grid = occupancy_grid(STRAIGHT, 0.5, WORLD)
    beside = replace(grid, clearance_m=np.where(grid.free, np.float32(2.0), np.float32(0.0)))
    x, y = entrance_anchor(beside, (50.25, 0.25), 4.0, 0.5).anchor_m
    row, col = np.floor((np.array([y, x]) - grid.origin_m[::-1]) / 0.5).astype(int)
    assert grid.free[row - 1 : row + 2, col - 1 : col + 2].all()


def test_the_nav2_map_shows_the_cells_of_the_grid():
    grid = occupancy_grid(TEE, 0.5, (-4.0, -4.0, 84.0, 44.0))
    image, text = nav2_map(grid)
    meta = yaml.safe_load(text)
    assert ((image == 254)[::-1] == grid.free).all()
    assert meta["resolution"] == 0.5
    assert meta["origin"] == [grid.origin_m[0], grid.origin_m[1], 0.0]
    assert "/" not in meta["image"]


def test_the_cell_of_a_wide_mine_is_the_least_that_a_bundle_holds_and_a_remark_names_it():
    box = (-3.1, -8.2, 5603.3, 7706.1)
    with collect_remarks() as remarks:
        cell = cell_within_bundle(0.25, box)
    assert [(remark.value, remark.option) for remark in remarks] == [("0.70 m", "compile3d.grid_cell_m")]
    west, south, east, north = (v / cell for v in box)
    cells = (np.ceil(east) - np.floor(west)) * (np.ceil(north) - np.floor(south))
    assert 0.8 * MOST_CELLS < cells <= MOST_CELLS
    with collect_remarks() as remarks:
        assert cell_within_bundle(0.25, (0.0, 0.0, 2400.0, 2500.0)) == 0.25
    assert not remarks


def test_a_mine_that_is_too_wide_for_any_map_is_refused():
    with pytest.raises(GeometryError, match=r"21000 x 24000 m.*at most 100,000,000 cells of at most 2 m"):
        cell_within_bundle(0.25, (0.0, 0.0, 21_000.0, 24_000.0))
