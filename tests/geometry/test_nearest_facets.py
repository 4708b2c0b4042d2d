"""Distances from triangles, however long and narrow, in 64 bits; the nearest one is found within a stated bound."""

import numpy as np
import pytest

from pipeline.geometry.nearest_facets import WITHIN_M, NearestFacets, closest_points
from pipeline.geometry.ray_scene import ray_scene

LENGTH_M, WIDTH_M, OVER_M = 16.0, 0.6, 0.25
NEEDLE = np.array([[0.0, 0, 0], [LENGTH_M, WIDTH_M, 0], [0.92 * LENGTH_M, WIDTH_M, 0]])


@pytest.mark.parametrize("over_m", [0.0, OVER_M])
def test_places_over_a_needle_are_as_far_from_it_as_they_are_high(over_m):
    places = np.random.default_rng(0).dirichlet(np.ones(3), 20_000) @ NEEDLE + [0, 0, over_m]
    found = NearestFacets.of(NEEDLE[None]).query(places)
    np.testing.assert_allclose(found.distance_m, over_m, atol=1e-12)
    np.testing.assert_allclose(found.place_m, places - [0, 0, over_m], atol=1e-12)
    # What it is for: Open3D's own distance is off by centimetres.
    plain = ray_scene(NEEDLE, np.array([[0, 1, 2]])).compute_distance(places.astype(np.float32)).numpy()
    assert np.abs(plain - over_m).max() > 0.002


@pytest.mark.parametrize(
    ("place", "nearest"),
    [
        ((1, 1, 2), (1, 1, 0)),  # over the triangle
        ((-3, -4, 0), (0, 0, 0)),  # before a corner
        ((2, -1, 1), (2, 0, 0)),  # beside a side
        ((5, 5, 0), (2, 2, 0)),  # beyond the longest one
    ],
)
def test_the_nearest_point_of_a_triangle_is_inside_on_a_side_or_at_a_corner(place, nearest):
    triangle = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]])
    for turned in (triangle, triangle[::-1], np.roll(triangle, 1, axis=0)):
        np.testing.assert_allclose(closest_points(turned[None], np.array([place], float))[0], nearest, atol=1e-12)


@pytest.mark.parametrize("corners", [(0, 1, 1), (0, 0, 1), (0, 1, 2), (2, 0, 1)])
def test_a_triangle_without_an_area_is_its_longest_side(corners):
    line = np.array([[0.0, 0, 0], [10, 0, 0], [3, 0, 0]])[list(corners)]
    found = NearestFacets.of(line[None]).query(np.array([[4.0, 3, 0], [14, 3, 0]]))
    np.testing.assert_allclose(found.distance_m, [3, 5], atol=1e-12)


def test_no_triangle_is_nearer_than_the_one_found_by_more_than_the_bound():
    rng = np.random.default_rng(1)
    ahead, aside = rng.standard_normal((2, 300, 1, 3))
    ahead *= rng.uniform(1, 30, (300, 1, 1)) / np.linalg.norm(ahead, axis=2, keepdims=True)
    aside *= 10 ** rng.uniform(-6, 0, (300, 1, 1))
    along = np.concatenate([np.zeros((300, 1, 1)), np.ones((300, 1, 1)), rng.uniform(0, 1, (300, 1, 1))], axis=1)
    triangles = rng.uniform(-200, 200, (300, 1, 3)) + along * ahead + np.array([[0], [0], [1]]) * aside
    shares, own = rng.dirichlet(np.ones(3), 2000), rng.integers(0, 300, 2000)
    places = np.einsum("ni,nij->nj", shares, triangles[own]) + rng.uniform(0, 2, (2000, 1)) * rng.standard_normal(
        (2000, 3)
    )
    found = NearestFacets.of(triangles).query(places)
    near = np.min(
        [np.linalg.norm(closest_points(np.repeat(t[None], 2000, 0), places) - places, axis=1) for t in triangles],
        axis=0,
    )
    assert (found.distance_m >= near - 1e-12).all()
    assert (found.distance_m - near).max() <= WITHIN_M
    assert np.abs(NearestFacets.of(triangles).rough_distances(places) - near).max() <= WITHIN_M
    own_m = np.linalg.norm(closest_points(triangles[found.facet], places) - places, axis=1)
    np.testing.assert_array_equal(found.distance_m, own_m)


def test_triangles_are_numbered_over_more_than_one_block(monkeypatch):
    monkeypatch.setattr("pipeline.geometry.nearest_facets._BLOCK", 4)
    triangles = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]) + 2 * np.arange(11)[:, None, None] * [1.0, 0, 0]
    found = NearestFacets.of(triangles).query(2.0 * np.arange(11)[:, None] * [1, 0, 0] + [0, 0, 1.0])
    np.testing.assert_array_equal(found.facet, np.arange(11))
    np.testing.assert_allclose(found.distance_m, 1, atol=1e-12)
