import networkx as nx
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter
from shapely.affinity import rotate
from skimage.morphology import skeletonize

from pipeline.errors import GeometryError
from pipeline.geometry.network.lee_thinning import thin_mask
from pipeline.geometry.network.leg_graph import LegGraph, prune_spurs
from pipeline.geometry.network.skeleton import _farthest_pair, trace_network
from pipeline.geometry.network.thinning import skeleton_of, thin_polygon
from tests.mines import RING, STRAIGHT, TEE, random_mine


def network(mine, cell=0.25):
    return trace_network(mine, cell, 2.0, 3.0)


def test_a_straight_drift_is_one_leg_with_two_dead_ends():
    n = network(STRAIGHT)
    assert (len(n.legs), len(n.dead_ends), len(n.junctions), n.loops, n.components) == (1, 2, 0, 0, 1)
    # Thinning stops half a width short of a face, or runs into one of its corners.
    assert 95 - 1 <= n.total_length_m <= 101
    assert max(n.legs[0].half_width_m) == pytest.approx(2.5, abs=0.13)


def test_a_ring_drift_is_one_loop_as_long_as_its_centre_line():
    n = network(RING)
    assert (n.loops, n.components, n.dead_ends) == (1, 1, [])
    assert n.total_length_m == pytest.approx(2 * (54 + 34), rel=0.03)


def test_a_t_junction_has_three_legs_and_one_junction():
    n = network(TEE)
    assert (len(n.legs), len(n.dead_ends), len(n.junctions), n.loops) == (3, 3, 1, 0)
    assert np.linalg.norm(np.array(n.nodes_m[n.junctions[0]]) - [40.5, 2.5]) < 1.5


def test_the_main_drift_of_a_t_junction_is_its_longest_route():
    n = network(TEE)
    assert n.main_drift_length_m == pytest.approx(77, abs=4)
    assert n.main_drift_m[0][0] < n.main_drift_m[-1][0]


def test_the_longest_route_is_that_between_all_pairs_of_nodes():
    rng = np.random.default_rng(1)
    graph, wanted = LegGraph(), nx.MultiGraph()
    wanted.add_nodes_from(range(300))
    for node in range(300):
        graph.add_node(node, np.zeros(2))
    for p, q in rng.integers(0, 300, (400, 2)).tolist():
        length = float(rng.uniform(1, 9))
        graph.add_leg(p, q, np.array([[0.0, 0.0], [length, 0.0]]))
        wanted.add_edge(p, q, length=length)
    apart = {
        (a, b): round(d, 6)
        for a, to in nx.all_pairs_dijkstra_path_length(wanted, weight="length")
        for b, d in to.items()
    }
    most = max(apart.values())
    assert _farthest_pair(graph) == min(pair for pair, length in apart.items() if length == most)


def test_of_two_short_legs_at_a_fork_one_remains_as_the_end_of_the_drift():
    graph = LegGraph()
    for node, xy in enumerate([(0, 0), (20, 0), (22, 1), (22.5, -1)]):
        graph.add_node(node, np.array(xy, float))
    for end in (0, 2, 3):
        graph.add_leg(end, 1, np.array([graph.places_m[end], graph.places_m[1]]))
    prune_spurs(graph, {0: 2.0, 1: 2.0, 2: 0.3, 3: 0.3}, 2.0)
    (leg,) = graph.legs
    assert {leg.first, leg.last} == {0, 3}  # the shorter of the two went first, and the other is then no spur any more
    assert leg.length_m == pytest.approx(20 + np.hypot(2.5, 1))


@given(seed=st.integers(0, 10_000), drifts=st.integers(1, 8))
@settings(deadline=None, max_examples=40)
def test_the_network_of_a_random_mine_is_connected_and_has_a_loop_for_each_island(seed, drifts):
    # Thin cracks are closed; the rest may still be thinner than the first cell.
    mine = random_mine(np.random.default_rng(seed), drifts).buffer(0.1).buffer(-0.1)
    islands = [hole for hole in mine.interiors if shapely.Polygon(hole).buffer(-0.1).area > 0]
    n = network(shapely.Polygon(mine.exterior, islands))
    assert n.components == 1
    assert n.loops == len(islands)


def test_a_network_does_not_cross_rock_thinner_than_a_cell():
    cracked = shapely.union_all([shapely.box(0, 0, 40, 5), shapely.box(0, 0, 5, 20), shapely.box(0, 15, 40, 20)])
    cracked = shapely.union_all([cracked, shapely.box(35, 5, 40, 9.9), shapely.box(35, 10, 40, 15)])  # 0.1 m of rock
    assert network(cracked).loops == 0


@pytest.mark.parametrize("turn_deg", range(0, 180, 15))
def test_the_sharp_tip_of_a_pillar_is_no_island_of_its_own(turn_deg):
    pillar = rotate(shapely.Polygon([(20, 10), (40, 18), (40, 20)]), turn_deg)
    assert trace_network(shapely.box(0, -10, 60, 40).difference(pillar), 0.25, 2.0, 3.0).loops == 1


def test_a_pillar_whose_first_cell_is_on_its_edge_stays_beside_a_sharp_tip():
    """A bug in a mine of 218 km: the pillar counted as rock outside, so it was cut off and became free."""
    tip, pillar = shapely.Polygon([(5, 5), (45, 12), (45, 13)]), shapely.box(10, 40.125, 50, 50.125)
    mine = shapely.box(0, -10, 60, 60).difference(tip).difference(pillar)
    assert thin_polygon(mine, 0.25)[0].loops == 2


def test_four_pixels_where_two_drifts_cross_are_no_loop():
    """Thinning leaves a square of four pixels at the crossing of these drifts."""
    drift = shapely.box(-20, -2.2, 20, 2.2)
    crossing = rotate(drift.union(rotate(drift, 90, origin=(0, 0))), 45, origin=(0, 0))
    skeleton, _ = thin_polygon(crossing, 0.25)
    assert (skeleton.loops, skeleton.components) == (0, 1)
    assert nx.cycle_basis(nx.Graph(skeleton.links.tolist())) == []


@given(seed=st.integers(0, 10_000), blurred=st.booleans(), share=st.floats(0.2, 0.98))
@settings(deadline=None, max_examples=100)
def test_a_thinned_mask_is_the_skeleton_that_scikit_image_finds(seed, blurred, share):
    rng = np.random.default_rng(seed)
    noise = rng.random(rng.integers(1, 60, 2))
    noise = gaussian_filter(noise, 2.0) if blurred else noise
    mask = noise <= np.quantile(noise, share)
    assert np.array_equal(thin_mask(mask), np.argwhere(skeletonize(mask, method="lee")))


def test_cells_that_are_tried_one_by_one_keep_a_line_of_two_cells_connected():
    """Whether a cell of such a line goes depends on all before it."""
    mask = np.pad(np.repeat(np.eye(40, dtype=bool), 2, axis=1), 1)
    assert np.array_equal(thin_mask(mask), np.argwhere(skeletonize(mask, method="lee")))
    assert skeleton_of(thin_mask(mask)).components == 1


def test_a_skeleton_without_pixels_has_no_component():
    skeleton = skeleton_of(np.zeros((0, 2), int))
    assert (skeleton.loops, skeleton.components) == (0, 0)


def test_workings_thinner_than_a_cell_are_refused():
    with pytest.raises(GeometryError, match="some passage or pillar is thinner"):
        network(shapely.union_all([shapely.box(0, 0, 10, 5), shapely.box(9, 2, 20, 2.01), shapely.box(19, 0, 30, 5)]))


@pytest.mark.parametrize(
    "room", [shapely.box(0, 0, 20, 20), shapely.Point(0, 0).buffer(9, quad_segs=2)], ids=["square", "octagon"]
)
@pytest.mark.parametrize("turn_deg", [0, 30])
def test_a_square_or_round_room_has_one_leg(room, turn_deg):
    assert len(network(rotate(room, turn_deg)).legs) == 1


def test_a_pillar_on_a_neck_thinner_than_a_cell_stays_rock():
    """Its cells were taken for a sharp tip and filled: the network led through the rock."""
    neck = shapely.box(10.0, -1.0, 10.1, 4.0)
    ring = shapely.box(0, 0, 20, 20) - shapely.box(3, 3, 17, 17) - neck
    network = trace_network(ring, 0.25, 2.0, 3.0)
    assert network.loops == 0
    assert len(network.dead_ends) == 2
    assert network.total_length_m == pytest.approx(4 * 17 - 2 * 1.5, abs=2)  # ends stop half a width short
    assert min(half for leg in network.legs for half in leg.half_width_m[1:-1]) > 1.0
