import numpy as np
import pytest
import shapely

from pipeline.geometry.nearest_edges import distances_to_edges, nearest_edges
from pipeline.geometry.polyline import rings_of
from tests.mines import random_mine


def edges_of(polygon):
    rings = [shapely.get_coordinates(ring) for ring in rings_of(polygon)]
    return np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])


def searched(edges, places):
    tree = shapely.STRtree(shapely.linestrings(edges))
    found = tree.query_nearest(shapely.points(places), return_distance=True, all_matches=False)
    return found[1]


@pytest.mark.parametrize("origin_m", [(0.0, 0.0), (512_345.678, 7_654_321.987)])
def test_places_along_walls_have_the_distances_of_a_search_to_the_last_bit(origin_m):
    rng = np.random.default_rng(4)
    edges = edges_of(random_mine(rng, 6)) + origin_m
    chosen = rng.integers(len(edges), size=60_000)
    share = rng.uniform(-0.1, 1.1, (len(chosen), 1))
    on_walls = edges[chosen, 0] * (1 - share) + edges[chosen, 1] * share
    places = np.vstack([on_walls + rng.normal(0, 0.3, on_walls.shape), edges.reshape(-1, 2)])
    found = nearest_edges(edges, places)
    assert (found.distance_m == searched(edges, places)).all()
    assert (distances_to_edges(places, edges[found.edge]) == found.distance_m).all()


def test_places_in_the_middle_of_a_round_room_have_all_its_walls_as_candidates():
    rng = np.random.default_rng(5)
    edges = edges_of(shapely.Point(0, 0).buffer(9, quad_segs=64))
    places = rng.normal(0, 0.1, (5_000, 2))
    assert (nearest_edges(edges, places).distance_m == searched(edges, places)).all()


def test_many_places_are_compared_with_few_edges_and_not_searched_one_by_one(monkeypatch):
    """Points of a wall are given to the tree by cell: 40,000 points in 30 m are 60 to 240 cells."""
    edges = edges_of(shapely.box(0, 0, 30, 5))
    rng = np.random.default_rng(6)
    places = np.column_stack([rng.uniform(0, 30, 40_000), rng.normal(0, 0.1, 40_000)])
    asked = []
    points = shapely.points
    monkeypatch.setattr(shapely, "points", lambda at: asked.append(len(at)) or points(at))
    nearest_edges(edges, places)
    assert sum(asked) < 1_000


def test_an_edge_without_length_is_as_far_as_its_end():
    edges = np.array([[[1.0, 1.0], [1.0, 1.0]]])
    assert nearest_edges(edges, np.full((100, 2), [4.0, 5.0])).distance_m == pytest.approx(5.0)


def test_no_places_have_no_edges():
    assert len(nearest_edges(np.array([[[0.0, 0.0], [1.0, 0.0]]]), np.zeros((0, 2))).edge) == 0
