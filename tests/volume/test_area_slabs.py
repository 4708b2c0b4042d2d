"""Drawn floors as solids: slabs with plumb walls, the shafts between them, and roofs that cut through floors."""

import manifold3d
import numpy as np
import pytest

from pipeline.errors import GeometryError
from pipeline.types import DrawnFloors, FloorMesh
from pipeline.volume.areas import solid_of_floors

SQUARE = np.array([[0, 0, 0], [10, 0, 1], [10, 8, 1], [0, 8, 0]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def floors(*heights):
    """Return squares that rise by a metre, over each other."""
    vertices = [SQUARE + np.array([0, 0, z]) for z in heights]
    return FloorMesh(np.concatenate(vertices), np.concatenate([FACES + 4 * k for k in range(len(heights))]), 100.0)


def solid(mesh):
    found = manifold3d.Manifold(manifold3d.Mesh64(np.array(mesh.vertices, order="C"), mesh.faces.astype(np.uint64)))
    assert found.status() == manifold3d.Error.NoError
    return found


def test_a_slab_has_the_drawn_floor_and_a_roof_so_high_over_it():
    mesh = solid_of_floors(DrawnFloors(floors(0)), 3.5, 1.0)
    assert solid(mesh).volume() == pytest.approx(80 * 3.5)
    assert (solid(mesh).num_tri(), mesh.datum_m) == (12, 100.0)
    assert {tuple(place) for place in mesh.vertices.round(9).tolist()} >= {tuple(place) for place in SQUARE.tolist()}


def test_floors_over_each_other_are_two_closed_parts_of_one_solid():
    found = solid(solid_of_floors(DrawnFloors(floors(0, 6)), 3.5, 1.0))
    assert len(found.decompose()) == 2
    assert found.volume() == pytest.approx(2 * 80 * 3.5)


def test_a_roof_that_cuts_the_floor_over_it_is_refused_with_its_place_and_what_states_less():
    with pytest.raises(GeometryError, match=r"less than their height of 3.5 m apart .* compile3d.height_m states less"):
        solid_of_floors(DrawnFloors(floors(0, 3)), 3.5, 1.0)
