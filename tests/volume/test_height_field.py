"""Floors are decided before passages are united: one height field for legs that meet, and a slab over it."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from benchmarks.comparisons.volume.cases import CASES, GateCase
from minexplore.floors.volume_arrays import FacetLabel
from pipeline.geometry.facets.crossings import CROSSING_M, crossing_facets
from pipeline.volume.floor_error import measure_floor
from pipeline.volume.floors import _united, solve_floors
from pipeline.volume.height_field.heights import solve_heights
from pipeline.volume.height_field.leg_lines import drop
from pipeline.volume.height_field.section_floors import SectionFloors
from pipeline.volume.height_field.slabs import slabs_of
from pipeline.volume.union import pieces_of, unite
from tests.heights import HEADER

BEND = "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,4,3,0\nA,3,20,20,2,2,8,3,0\n"  # 90 deg on a ramp of 20 %
# A ramp of 4 m in 15 m parts by 15 deg from a level drift.
PARTING = (
    "A,1,-10,0,2,2,0,3,0\nA,2,0,0,2,2,0,3,0\nA,3,30,0,2,2,0,3,0\n"
    "B,2,0,0,2,2,0,3,0\nB,4,14.489,3.882,2,2,-4,3,0\nB,5,30,8.04,2,2,-4,3,0\n"
)
# A low passage from the foot of a drift's step leads back under the drift's floor.
UNDER = (
    "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,0,3,0\n"
    "B,2,20,0,0.6,0.6,0,0.8,0\nB,3,16,0.5,0.6,0.6,-0.9,0.8,0\nB,4,6,0.5,0.6,0.6,-1.2,0.8,0\n"
)


def solved(rows, folder):
    network = GateCase("test", HEADER + rows).network(folder)
    rough = unite(network, pieces_of(network))
    return network, rough, solve_floors(network)


@pytest.mark.parametrize("case", ["spiral", "levels", "tee"])
def test_an_edge_of_the_surface_has_two_triangles_at_most_and_a_vertex_one_fan(case, tmp_path):
    network = CASES[case].network(tmp_path)
    surface = solve_heights(network, pieces_of(network)).surface
    assert len(np.unique(surface.mates)) == surface.mates.size
    edges = np.stack([surface.corners, np.roll(surface.corners, -1, axis=1)], axis=2).reshape(-1, 2)
    assert np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)[1].max() == 2
    rim = edges[surface.rim]
    assert np.bincount(rim[:, 0]).max() == np.bincount(rim[:, 1]).max() == 1
    ends = surface.places[surface.spots.ravel()[surface.mates]]
    others = surface.places[np.roll(surface.spots, -1, axis=1).ravel()[surface.mates[:, ::-1]]]
    assert np.array_equal(ends, others)


def test_heights_between_two_sections_are_level_along_each_section(tmp_path):
    network = GateCase("bend", HEADER + "A,1,0,0,2,2,0,3,0\nA,2,10,0,2,2,1,3,0\nA,3,19,4,1,1,2,3,0\n").network(tmp_path)
    pieces = pieces_of(network)
    floors = SectionFloors.of(network, pieces)
    left, right = pieces[0].footprint[1:3]
    places = left + np.linspace(0.01, 0.99, 7)[:, None] * (right - left)
    for leg in (0, 1):
        assert floors.heights_at(np.full(7, leg), places) == pytest.approx(network.floors_m[0, 1, 2], abs=1e-6)


def test_the_floors_of_a_spiral_over_itself_are_closed_slabs_that_do_not_cross_themselves(tmp_path):
    network = CASES["spiral"].network(tmp_path)
    pieces, keys = pieces_of(network), dict[int, int]()
    for slab in slabs_of(solve_heights(network, pieces), pieces, keys):
        mesh = slab.to_mesh64()
        assert slab.volume() > 0
        assert not len(crossing_facets(np.array(mesh.vert_properties), np.asarray(mesh.tri_verts, int), CROSSING_M))
    assert {key % len(FacetLabel) for key in keys.values()} == {FacetLabel.FLOOR, FacetLabel.WALL}


@pytest.mark.parametrize("rows", [PARTING, UNDER], ids=["parting", "under"])
def test_ways_that_part_slowly_and_ways_under_a_floor_have_no_step_and_keep_the_survey(rows, tmp_path):
    network, _rough, volume = solved(rows, tmp_path)
    found = measure_floor(volume, network)
    assert found.error_m < 0.01
    assert found.step_m < 0.01
    assert found.share_built == 1
    assert not len(crossing_facets(volume.vertices, volume.faces, CROSSING_M))


def test_the_inner_corner_of_a_bend_on_a_ramp_is_smooth(tmp_path):
    network, _, volume = solved(BEND, tmp_path)
    middle = network.places_m[1, :2]
    x, y = np.meshgrid(np.arange(-3, -1, 0.05), np.arange(1, 3, 0.05))
    grid = np.stack([x + middle[0], y + middle[1], np.full(x.shape, network.places_m[1, 2] + 1.5)], axis=2)
    hit, height = drop(volume.vertices, volume.faces, grid.reshape(-1, 3))
    height = np.where(volume.label[hit] == FacetLabel.FLOOR, height, np.nan).reshape(x.shape)
    assert np.isfinite(height).sum() > 500
    assert np.nanmax(np.abs(height[:, 5:] - height[:, :-5])) < 0.15
    assert np.nanmax(np.abs(height[5:] - height[:-5])) < 0.15


def test_a_straight_drift_is_level_across_on_its_slope(tmp_path):
    network, _, volume = solved("A,1,0,0,2,2,0,3,0\nA,2,40,10,2,2,6,3,0\n", tmp_path)
    way = (network.places_m[1] - network.places_m[0])[:2] / np.hypot(40, 10)
    floor = volume.vertices[np.unique(volume.faces[volume.label == FacetLabel.FLOOR])]
    along = (floor[:, :2] - network.places_m[0, :2]) @ way
    assert floor[:, 2] - network.places_m[0, 2] == pytest.approx(along * 6 / np.hypot(40, 10), abs=1e-4)


def test_a_drift_far_below_does_not_part_a_floor_and_a_floor_goes_on_through_the_sections_of_its_tube(tmp_path):
    rows = "A,1,-30,0,2,2,0,3,0\nA,2,30,0,2,2,0,3,0\nA,3,40,-20,2,2,-4,3,0\n"
    rows += "A,4,0.3,-20,2,2,-8,3,0\nA,5,0.3,20,2,2,-8,3,0\n"
    network = GateCase("crossing", HEADER + rows).network(tmp_path)
    pieces = pieces_of(network)
    surface = solve_heights(network, pieces).surface
    drift = [pieces[some[0]].shot == 0 and len(some) == 1 for some in surface.pieces]
    places = surface.places[surface.spots[np.array(drift)[surface.patch]]].reshape(-1, 2)
    assert len(places) > 100
    assert not np.isclose(places[:, :1], (-1.7, 0.3, 2.3), atol=1e-3).any()  # where the lower drift crosses
    assert len(surface.over) > 0
    links = coo_matrix((np.ones(len(surface.mates)), (surface.mates // 3).T), (len(surface.spots),) * 2)
    assert connected_components(links, directed=False)[0] == 1


def test_facets_beside_a_steep_leg_are_of_the_leg_that_they_bound(tmp_path):
    rows = "A,1,-10,0,2,2,0,3,0\nA,2,0,0,2,2,0,3,0\nA,3,10,2,2,2,5,3,0\nA,4,20,0,2,2,5,3,0\n"
    network = GateCase("test", HEADER + rows).network(tmp_path)
    united = _united(network, pieces_of(network))
    corners = [piece.sections.reshape(-1, 3) for piece in united.pieces]
    low, high = (np.array([f(some, axis=0) for some in corners])[united.source] for f in (np.min, np.max))
    middles = united.vertices[united.faces].mean(axis=1)
    assert (middles > low - 0.05).all()
    assert (middles < high + 0.05).all()
