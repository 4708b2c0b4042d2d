"""Which places are in the free space of a volume."""

import manifold3d
import numpy as np

from pipeline.volume.rock.inside import Inside
from pipeline.volume.union import Volume


def test_the_solid_angle_finds_free_space_that_rays_take_for_rock(monkeypatch):
    solid = manifold3d.Manifold.cube((4.0, 3.0, 2.0)) - manifold3d.Manifold.cube((1.0, 1.0, 2.0)).translate((1, 1, 0))
    mesh = solid.to_mesh64()
    vertices, faces = np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts, np.int64)
    none = np.zeros(len(faces), int)
    inside = Inside(Volume(vertices, faces, none, none, []))
    places = np.array([[0.5, 0.5, 1.0], [1.5, 1.5, 1.0], [3.999, 2.999, 0.001], [4.001, 1.0, 1.0], [0.9999, 1.5, 1.9]])
    in_rock = np.array([False, True, False, True, False])
    assert (inside.are_in_rock(places) == in_rock).all()
    monkeypatch.setattr(Inside, "distance_m", lambda _, some: np.full(len(some), -1.0))  # every ray miscounts
    assert (inside.are_in_rock(places) == in_rock).all()
