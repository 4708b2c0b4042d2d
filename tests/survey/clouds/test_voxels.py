"""Sets of voxels against dense arrays, and surfaces with fewer facets."""

import numpy as np
import pytest
from scipy import ndimage

from pipeline.survey.clouds.flood import Walls
from pipeline.survey.clouds.voxels import STEPS, cells_of_keys, components_of, grown, is_in, keys_of, offsets_of

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


@pytest.mark.parametrize(("share", "seed"), [(0.0, 0), (0.01, 0), (0.01, 1), (0.05, 0), (0.05, 1)])
def test_where_a_roof_was_hardly_seen_the_flood_ends_without_dents(share, seed):
    cells = np.argwhere(np.ones((40, 30, 20), bool))
    low, high = cells.min(axis=0), cells.max(axis=0)
    edge, roof = ((cells == low) | (cells == high)).any(axis=1), cells[:, 2] == high[2]
    seen = edge & (~roof | (np.random.default_rng(seed).random(len(cells)) < share))
    walls = Walls(np.sort(keys_of(cells[seen])), 0.2)
    found = walls.flood(keys_of(np.array([[20, 15, 8]])))
    near = found.ends[:, None] + offsets_of(STEPS)
    dented = 2 * is_in(near, found.free).sum(axis=1) > (~is_in(near, walls.thick)).sum(axis=1)
    assert len(found.ends) > 600
    assert not dented.any()
    assert not is_in(found.free, walls.thick).any()
    assert cells_of_keys(found.free)[:, 2].max() <= high[2] + 1
