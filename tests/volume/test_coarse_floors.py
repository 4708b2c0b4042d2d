"""Floors with few facets keep their shape, their rim and the survey's heights."""

import numpy as np
import pytest

from benchmarks.comparisons.volume.cases import CASES, GateCase
from benchmarks.comparisons.volume.random_volumes import table_of
from minexplore.floors.volume_arrays import FacetLabel
from pipeline.geometry.facets.crossings import crossing_facets
from pipeline.volume import floors
from pipeline.volume.floor_error import measure_floor
from pipeline.volume.height_field.leg_lines import drop
from pipeline.volume.mesh_edges import MeshEdges, ranges
from pipeline.volume.shell import build_shell
from pipeline.volume.union import pieces_of, unite
from tests.heights import HEADER


def solved(case, folder):
    """Return a survey's network, its union, its floors before and after vertices go, and the finished volume."""
    network = case.network(folder)
    rough = unite(network, pieces_of(network))
    coarse, seen = floors.coarse_floors, []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(floors, "coarse_floors", lambda *given: seen.append((given[0], coarse(*given))) or seen[0][1])
        volume = floors.solve_floors(network)
    return network, rough, *seen[0], volume


@pytest.fixture(scope="module")
def spiral(tmp_path_factory):
    return solved(CASES["spiral"], tmp_path_factory.mktemp("spiral"))


def test_a_spiral_has_fewer_than_four_parts_a_metre_and_floors_within_a_centimetre_of_the_survey(spiral):
    network, _rough, _, _, volume = spiral
    assert len(build_shell(volume)) / network.lengths_m.sum() < 4
    assert measure_floor(volume, network).error_m < 0.01


def test_a_floor_moves_by_a_centimetre_at_most_and_two_fifths_of_its_facets_go(spiral):
    _, _, before, after, _ = spiral
    is_floor = before.label == FacetLabel.FLOOR
    assert (after.label == FacetLabel.FLOOR).sum() < 0.6 * is_floor.sum()
    wide = is_floor & (np.linalg.norm(before.normals, axis=1) > 0.1)  # the rim may move by 2 mm, from under slivers
    assert wide.sum() > is_floor.sum() / 2
    places = before.vertices[before.faces[wide]].mean(axis=1)
    hit, height = drop(after.vertices, after.faces, places + np.array([0, 0, 0.1]))
    assert (after.label[hit] == FacetLabel.FLOOR).all()
    assert np.abs(height - places[:, 2]).max() < 0.0101


def test_a_mesh_without_the_vertices_that_it_does_not_need_is_closed_and_does_not_cross_itself(spiral):
    _, _, before, after, _ = spiral
    assert len(crossing_facets(after.vertices, after.faces, 1e-6)) == 0
    assert after.solid.volume() == pytest.approx(before.solid.volume(), rel=1e-3)
    assert {tuple(place) for place in after.vertices.tolist()} <= {tuple(place) for place in before.vertices.tolist()}


def test_a_floor_keeps_7_mm_to_the_survey_all_along_its_legs_as_vertices_go(tmp_path):
    network, _rough, before, after, _ = solved(GateCase("mine 14", table_of("mine", 14)), tmp_path)
    assert measure_floor(before, network).error_m < 0.007
    assert measure_floor(after, network).error_m < 0.0071


def test_a_floor_from_which_a_wall_goes_down_keeps_its_height(tmp_path):
    rows = "A,1,-20,0,2,2,0,3,0\nA,2,20,0,2,2,0,3,0\n"
    rows += "B,3,-8,-24,2,2,2,3,0\nB,4,0,-12,2,2,0.6,3,0\nB,5,0,12,2,2,0.6,3,0\nB,6,8,24,2,2,2,3,0\n"
    network, _rough, before, after, _ = solved(GateCase("over", HEADER + rows), tmp_path)
    (hole,) = measure_floor(before, network).elsewhere
    assert hole.off_m == pytest.approx(-0.6, abs=0.01)
    assert measure_floor(after, network).elsewhere[0].off_m == pytest.approx(hole.off_m, abs=1e-6)
    assert (after.label == FacetLabel.FLOOR).sum() < (before.label == FacetLabel.FLOOR).sum() / 2


def test_edges_about_a_vertex_are_all_that_start_there():
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])  # a tetrahedron
    edges = MeshEdges(faces, np.arange(4), np.array([0, 1, 1, 1]), 4)
    at = edges.find(np.array([0, 3, 1]), np.array([1, 0, 1]))
    assert at[2] == -1
    number, around = edges.around(at[:2])
    assert sorted(edges.end[around[number == 0]].tolist()) == [1, 2, 3]
    assert sorted(edges.end[around[number == 1]].tolist()) == [0, 1, 2]
    assert sorted(zip(edges.start[edges.is_rim].tolist(), edges.end[edges.is_rim].tolist(), strict=True)) == [
        (0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)
    ]  # fmt: skip


def test_starts_that_have_a_neighbour_in_common_do_not_go_together():
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    edges = MeshEdges(faces, np.arange(4), np.zeros(4, int), 4)
    chosen, beside = edges.apart(edges.find(np.array([3, 0]), np.array([0, 1])))
    assert edges.start[chosen].tolist() == [3]
    assert sorted(beside.tolist()) == [0, 1, 2]


def test_ranges_follow_each_other_and_empty_ones_are_left_out():
    number, at = ranges(np.array([5, 0, 2]), np.array([7, 0, 3]))
    assert number.tolist() == [0, 0, 2]
    assert at.tolist() == [5, 6, 2]
