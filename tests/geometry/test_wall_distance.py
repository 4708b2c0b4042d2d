import numpy as np
import pytest
import shapely

from pipeline.geometry.wall_distance import distances_to_walls
from tests.mines import random_mine

RING = shapely.box(0, 0, 10, 10).difference(shapely.box(4, 4, 6, 6))


def test_places_are_as_far_from_the_nearest_wall_as_drawn_inside_outside_and_in_islands():
    places = np.array([[2, 5], [5, 5], [-3, 5], [13, 14], [10, 3], [3.9, 5]])
    assert distances_to_walls(RING, places) == pytest.approx([2, 1, 3, 5, 0, 0.1])
    assert distances_to_walls(RING, np.zeros((0, 2))).shape == (0,)


def test_distances_are_those_to_the_whole_boundary():
    rng = np.random.default_rng(3)
    mine = random_mine(rng, 6)
    places = rng.uniform(-10, 120, (2000, 2))
    assert (distances_to_walls(mine, places) == shapely.distance(mine.boundary, shapely.points(places))).all()
