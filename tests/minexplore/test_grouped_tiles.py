"""Rows by the tile that they are in."""

import numpy as np
import pytest

from minexplore.tiles import group_by_tile


@pytest.mark.parametrize("dimensions", [2, 3])
def test_every_row_is_in_the_group_of_its_tile_and_tiles_are_in_order(dimensions):
    tiles = np.random.default_rng(1).integers(-2, 3, (60, dimensions))
    groups = group_by_tile(tiles)
    names = [name for name, _ in groups]
    assert names == sorted({tuple(row) for row in tiles.tolist()})
    for name, rows in groups:
        np.testing.assert_array_equal(rows, np.flatnonzero((tiles == name).all(axis=1)))


def test_no_row_makes_no_group():
    assert group_by_tile(np.zeros((0, 2), dtype=int)) == []
