"""What of a changed mesh crosses more than before, and the legs that are near along a survey."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from benchmarks.comparisons.volume.cases import CASES, GateCase
from pipeline.geometry.facets.crossings import CROSSING_M, crosses_more, crossing_facets
from pipeline.volume.union import pieces_of, unite
from tests.heights import levels, table


@pytest.fixture(scope="module")
def tee(tmp_path_factory):
    network = CASES["tee"].network(tmp_path_factory.mktemp("tee"))
    return unite(network, pieces_of(network))


def test_a_vertex_that_is_put_through_the_far_wall_makes_the_facets_cross_that_all_facets_show(tee):
    before = tee.vertices, tee.faces
    moved = tee.vertices.copy()
    moved[tee.faces[0, 0]] += 100 * np.array([0.6, 0.8, 0])
    wanted = np.unique(crossing_facets(moved, tee.faces, CROSSING_M))
    assert len(wanted) > 2
    assert (crosses_more(moved, tee.faces, before, CROSSING_M) == wanted).all()
    assert not len(crosses_more(*before, before, CROSSING_M))
    order = np.random.default_rng(0).permutation(len(tee.faces))
    assert not len(crosses_more(tee.vertices, np.roll(tee.faces[order], 1, axis=1), before, CROSSING_M))


def test_a_mesh_that_crosses_less_than_before_crosses_no_more(tee):
    moved = tee.vertices.copy()
    moved[tee.faces[0, 0]] += 100 * np.array([0.6, 0.8, 0])
    assert not len(crosses_more(tee.vertices, tee.faces, (moved, tee.faces), CROSSING_M))


def test_the_legs_near_a_leg_are_those_that_shortest_ways_between_stations_find(tmp_path):
    network = GateCase("levels", table(levels())).network(tmp_path)
    n = len(network.places_m)
    ways = dijkstra(coo_matrix((network.lengths_m, network.shots.T), (n, n)).tocsr(), directed=False)
    one, other = np.meshgrid(*[np.arange(len(network.shots))] * 2, indexing="ij")
    for reach_m in (5.0, 25.0):
        near = (ways[network.shots] <= reach_m).any(axis=1)
        wanted = near[:, network.shots].any(axis=2)
        assert 0 < wanted.sum() < wanted.size
        assert (network.near_legs(reach_m).has(one, other) == wanted).all()


def test_meshes_that_are_tried_together_cross_themselves_as_each_does_alone(tee):
    moved = tee.vertices.copy()
    moved[tee.faces[0, 0]] += 100 * np.array([0.6, 0.8, 0])
    places = [tee.vertices, moved, tee.vertices + 0.5]
    count, n = len(tee.faces), len(tee.vertices)
    faces = np.concatenate([tee.faces + n * k for k in range(3)])
    of = np.repeat(np.arange(3), count)
    found = crossing_facets(np.concatenate(places), faces, CROSSING_M, of=of)
    assert (found == count + crossing_facets(moved, tee.faces, CROSSING_M)).all()
    assert len(crossing_facets(np.concatenate(places), faces, CROSSING_M)) > len(found) > 0
