"""Sets of voxels against dense arrays, and surfaces with fewer facets."""

import numpy as np
import pytest
from scipy import ndimage

from pipeline.survey.clouds.flood import Walls
from pipeline.survey.clouds.voxels import cells_of_keys, components_of, grown, is_in, keys_of

SIZE = 12


@pytest.fixture
def dense():
    return np.random.default_rng(0).random((SIZE, SIZE, SIZE)) < 0.03


def keys(dense, shift=(-5, 0, 7)):
    return np.sort(keys_of(np.argwhere(dense) + shift))


def test_numbers_and_cells_are_one_to_one():
    cells = np.random.default_rng(0).integers(-(1 << 18), 1 << 18, (1000, 3))
    assert np.array_equal(cells_of_keys(keys_of(cells)), cells)


def test_a_set_grows_by_its_26_neighbours(dense):
    wide = np.pad(dense, 2)
    wanted = ndimage.binary_dilation(wide, np.ones((3, 3, 3)), iterations=2)
    assert np.array_equal(grown(keys(wide), 2), keys(wanted))


def test_membership_is_that_of_the_set(dense):
    every = keys(np.ones_like(dense))
    assert is_in(every, keys(dense)).sum() == dense.sum()
    assert not is_in(every, np.zeros(0, np.int64)).any()


def test_components_are_those_of_26_neighbours(dense):
    _, count = ndimage.label(dense, np.ones((3, 3, 3)))
    assert components_of(keys(dense)).max() + 1 == count


def test_a_wall_is_counted_in_each_direction_in_which_it_lies():
    cube = np.zeros((21, 21, 21), bool)
    cube[[0, -1]] = cube[:, [0, -1]] = cube[:, :, [0, -1]] = True
    walls = Walls(keys(cube, (0, 0, 0)), 0.2)
    assert walls.hits(np.array([[10, 10, 10], [100, 10, 10], [-100, 10, 10]]))[0].tolist() == [26, 1, 1]
