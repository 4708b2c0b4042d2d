"""Which places are in the free space of a volume."""

import manifold3d
import numpy as np
import pytest

from pipeline.geometry.facets.inside import Inside
from pipeline.geometry.facets.solid_angle import SolidAngle


def test_the_solid_angle_finds_free_space_that_rays_take_for_rock(monkeypatch):
    solid = manifold3d.Manifold.cube((4.0, 3.0, 2.0)) - manifold3d.Manifold.cube((1.0, 1.0, 2.0)).translate((1, 1, 0))
    mesh = solid.to_mesh64()
    vertices, faces = np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts, np.int64)
    inside = Inside(vertices, faces)
    places = np.array([[0.5, 0.5, 1.0], [1.5, 1.5, 1.0], [3.999, 2.999, 0.001], [4.001, 1.0, 1.0], [0.9999, 1.5, 1.9]])
    in_rock = np.array([False, True, False, True, False])
    assert (inside.are_in_rock(places) == in_rock).all()
    monkeypatch.setattr(Inside, "distance_m", lambda _, some: np.full(len(some), -1.0))  # every ray miscounts
    assert (inside.are_in_rock(places) == in_rock).all()


def ring():
    """Return the vertices and facets of a ring of 20 m, so that places in its hole are in the boxes of blocks."""
    solid = manifold3d.Manifold.cylinder(2, 10, 10, 400) - manifold3d.Manifold.cylinder(2, 8, 8, 400)
    mesh = solid.refine(2).to_mesh64()
    return np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts, np.int64)


@pytest.mark.parametrize("thrice", [False, True])
def test_blocks_seen_by_their_borders_fill_the_solid_angle_of_their_facets(thrice, monkeypatch):
    vertices, faces = ring()
    if thrice:  # once turned over, so that edges have six facets and the angle is as before
        faces = np.concatenate([faces, faces[:, [0, 2, 1]], faces])
    rng = np.random.default_rng(0)
    places = rng.uniform([-11, -11, -1], [11, 11, 3], (400, 3))
    radius = np.hypot(places[:, 0], places[:, 1])
    sure = (np.abs(radius - 9) < 0.9) | (np.abs(radius - 9) > 1.1)  # the ring has corners
    wanted = (np.abs(radius - 9) < 1) & (places[:, 2] > 0) & (places[:, 2] < 2)
    assert 20 < wanted[sure].sum() < 200
    summed = []
    angle = SolidAngle(vertices, faces)
    whole = np.arctan2
    monkeypatch.setattr(np, "arctan2", lambda over, under: summed.append(over.size) or whole(over, under))
    assert (angle.are_enclosed(places[sure]) == wanted[sure]).all()
    assert sum(summed) < 0.2 * len(faces) * sure.sum()
    assert len(summed) < 2 * len(places)  # many places at once
