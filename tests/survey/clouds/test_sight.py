"""What a scanner saw from where it was."""

import numpy as np
import pytest

from pipeline.survey.clouds.flood import Walls
from pipeline.survey.clouds.sight import nearest_in_sight, seen_from
from pipeline.survey.clouds.voxels import cells_at, cells_of_keys, keys_of

SIZE_M = 0.2


def box(size_m, without=""):
    """Return points 0.1 m apart on the six sides of a box from the origin, or on five."""
    low, high = np.zeros(3), np.array(size_m)
    sides = []
    for axis in range(3):
        steps = [np.arange(0, high[k] + 0.05, 0.1) for k in range(3) if k != axis]
        for end, value in (("low", low[axis]), ("high", high[axis])):
            if f"{end} {'xyz'[axis]}" != without:
                grid = np.stack(np.meshgrid(*steps, indexing="ij"), -1).reshape(-1, 2)
                sides.append(np.insert(grid, axis, value, axis=1))
    return np.concatenate(sides)


def walls(points):
    return Walls(np.unique(keys_of(cells_at(points, SIZE_M))), SIZE_M)


@pytest.fixture(scope="module")
def way():
    return np.column_stack([np.arange(0.8, 10.0, 0.5), np.full(19, 1.5), np.full(19, 1.3)])


def test_nearly_all_of_a_drift_is_seen_from_the_way_along_it_and_nothing_outside(way):
    seen = (cells_of_keys(seen_from(way, walls(box((10, 3, 3))))) + 0.5) * SIZE_M
    assert (seen > 0.2).all()
    assert (seen < np.array([10, 3, 3])).all()
    assert len(seen) * SIZE_M**3 > 0.95 * 9.2 * 2.2 * 2.2


def test_rays_that_meet_no_wall_show_no_free_space(way):
    seen = (cells_of_keys(seen_from(way, walls(box((10, 3, 3), "high z")))) + 0.5) * SIZE_M
    assert 2.5 < seen[:, 2].max() < 3.0 + 2 * SIZE_M  # others end at the walls' edges


def test_places_in_walls_see_nothing():
    assert len(seen_from(np.array([[0.1, 1.5, 1.5]]), walls(box((10, 3, 3))))) == 0


def test_a_point_is_seen_from_the_nearest_place_that_no_wall_hides(way):
    drift = walls(box((10, 3, 3)))
    points = np.array([[4.1, 0.0, 1.3], [4.1, 3.0, 1.3], [4.1, 1.5, 0.0]])
    normals = np.array([[0.0, 1, 0], [0, -1, 0], [0, 0, 1]])
    found = nearest_in_sight(points, normals, way, drift)
    assert found == pytest.approx(np.tile([4.3, 1.5, 1.3], (3, 1)), abs=0.21)
    behind = np.array([[4.1, -1.4, 1.3]])  # nearer than the way is to the drift's other wall
    assert nearest_in_sight(points[:1], normals[:1], np.concatenate([way, behind]), drift)[0, 1] == 1.5


def test_a_point_that_is_behind_a_wall_or_shows_its_back_is_seen_from_nowhere(way):
    drift = walls(np.concatenate([box((10, 3, 3)), box((10, 3, 3)) + np.array([0, 5, 0])]))
    points = np.array([[4.1, 8.0, 1.3], [4.1, 0.0, 1.3]])
    normals = np.array([[0.0, -1, 0], [0, -1, 0]])
    assert np.isnan(nearest_in_sight(points, normals, way, drift)).all()
