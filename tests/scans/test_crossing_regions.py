"""Winding numbers of closed meshes that cross themselves, and the surface of what they enclose."""

import manifold3d
import numpy as np
import pytest
import trimesh

from pipeline.scans.meshes.crossing_regions import rebuilt_within
from pipeline.scans.meshes.winding import WindingNumber

CELL_M = 0.05


def balls(*middles_m):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    n = len(ball.vertices)
    vertices = np.concatenate([ball.vertices + middle for middle in middles_m])
    return vertices, np.concatenate([ball.faces + k * n for k in range(len(middles_m))]).astype(int)


def test_two_balls_that_overlap_go_twice_about_what_they_share():
    middles = np.array([[0.0, 0, 0], [0.7, 0.4, -0.2]])
    vertices, faces = balls(*middles)
    places = np.random.default_rng(0).uniform(-1.5, 2.0, (20_000, 3))
    off = np.linalg.norm(places[:, None] - middles, axis=2)
    sure = (np.abs(off - 1.0) > 0.01).all(axis=1)
    found = WindingNumber(vertices, faces).at(places[sure], np.arange(sure.sum()), CELL_M)
    assert (found == (off[sure] < 1.0).sum(axis=1)).all()
    turned = WindingNumber(vertices, faces[:, ::-1]).at(places[sure], np.arange(sure.sum()), CELL_M)
    assert (turned == -found).all()


def test_rays_that_meet_edges_are_cast_again():
    box = trimesh.creation.box([2, 2, 2])  # each ray on the diagonal of top and bottom meets an edge
    places = np.linspace(-0.9, 0.9, 19)[:, None] * [1.0, 1.0, 0.5]
    assert (WindingNumber(box.vertices, box.faces).at(places, np.arange(19), CELL_M) == 1).all()


def test_a_place_on_a_corner_of_one_ball_is_inside_the_other_one():
    vertices, faces = balls([0.0, 0, 0], [0.7, 0.4, -0.2])
    place = np.array([[-0.3, 0.4, -0.2]])  # a plumb line through it touches the second ball alone
    assert (WindingNumber(vertices, faces).at(place + [[0, 0, z] for z in (-1e-7, 0, 1e-7)], np.arange(3), 1) > 0).all()


@pytest.mark.parametrize("cell_m", [0.05, 0.083])
def test_what_two_balls_enclose_is_found_without_facets_inside(cell_m):
    vertices, faces = balls([0.0, 0, 0], [0.7, 0.4, -0.2])
    found = manifold_of(*rebuilt_within(vertices, faces, cell_m, np.array([[[-1.2] * 3, [1.9] * 3]])))
    one, other = (manifold_of(*balls(middle)) for middle in ([0.0, 0, 0], [0.7, 0.4, -0.2]))
    assert found.status() == manifold3d.Error.NoError
    assert found.genus() == 0
    assert found.volume() == pytest.approx((one + other).volume(), rel=0.005)


def test_the_surface_ends_where_the_blocks_about_a_box_do():
    vertices, faces = balls([0.0, 0, 0])
    found = manifold_of(*rebuilt_within(vertices, faces, CELL_M, np.array([[[0.01] * 3, [0.35] * 3]])))
    assert found.volume() == pytest.approx((8 * CELL_M) ** 3 * 8, rel=0.03)  # a cell about the box is in 8 blocks


def manifold_of(vertices, faces):
    return manifold3d.Manifold(manifold3d.Mesh64(np.ascontiguousarray(vertices), faces.astype(np.uint64)))
