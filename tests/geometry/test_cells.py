import numpy as np

from pipeline.geometry.cells import plan_cells


def test_cells_are_those_of_a_search_for_distinct_pairs():
    places = np.random.default_rng(1).normal(-3, 20, (5_000, 2))
    wanted, of_place = np.unique(np.floor(places / 0.5).astype(int), axis=0, return_inverse=True)
    found = plan_cells(places, 0.5)
    np.testing.assert_array_equal(found.at, wanted)
    np.testing.assert_array_equal(found.of_place, of_place.ravel())


def test_no_places_have_no_cells():
    assert plan_cells(np.zeros((0, 2)), 0.5).at.shape == (0, 2)
