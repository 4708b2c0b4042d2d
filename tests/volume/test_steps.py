"""Steps between floors that rays of an uncut mesh find on a mesh that was cut from it."""

import numpy as np
import pytest

from benchmarks.comparisons.volume.cases import CASES
from pipeline.volume.floors import EDGE_M, NEAR_M
from pipeline.volume.folded.cuts import cut_ledges
from pipeline.volume.folded.steps import ALL_PLACES, MIDDLE, Steps, are_steps, walls_on_floors
from pipeline.volume.ledges import ledges_of
from pipeline.volume.union import Label, label_facets, pieces_of, unite


@pytest.fixture(scope="module")
def fine(tmp_path_factory):
    network = CASES["tee"].network(tmp_path_factory.mktemp("tee"))
    rough = unite(network, pieces_of(network))
    return label_facets(rough.solid.refine_to_length(EDGE_M), rough.pieces, rough.numbers), network.near_legs(NEAR_M)


@pytest.mark.parametrize("places", [MIDDLE, ALL_PLACES])
def test_steps_of_a_mesh_and_of_what_is_cut_from_it_are_those_of_rays_among_all_facets(fine, places):
    fine, near = fine
    is_ledge = ledges_of(fine, near)
    is_floor = is_ledge | (fine.label == Label.FLOOR)
    stays, steps = np.zeros(len(fine.faces), bool), Steps(fine, near)
    cut, _, parent = cut_ledges(fine, is_ledge)
    assert len(cut.faces) > len(fine.faces)
    for mesh, own in ((fine, np.arange(len(fine.faces))), (cut, parent), (fine, np.arange(len(fine.faces)))):
        floor = (fine.label == Label.FLOOR)[own]
        some = walls_on_floors(mesh, floor, stays[own])
        wanted = are_steps(mesh, floor, some, places, near)
        assert wanted.any()
        assert (steps.find(mesh, own, floor, some, places) == wanted).all()
        more = is_floor[own]
        some = walls_on_floors(mesh, more, stays[own])
        assert (steps.find(mesh, own, more, some, places) == are_steps(mesh, more, some, places, near)).all()


def test_a_cut_ledge_has_an_edge_that_is_plumb_in_each_of_its_facets(fine):
    fine, near = fine
    is_ledge = ledges_of(fine, near)
    cut, first, parent = cut_ledges(fine, is_ledge)
    normal = cut.normals
    plumb = is_ledge[parent] & (np.abs(normal[:, 2]) < 0.02 * np.linalg.norm(normal, axis=1))
    corners = first[cut.faces[plumb]]
    assert plumb.any()
    assert (corners == np.roll(corners, 1, axis=1)).any(axis=1).mean() > 0.99
    again, _, _ = cut_ledges(cut, is_ledge[parent])
    assert len(again.faces) == len(cut.faces)
