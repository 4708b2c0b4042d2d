"""Where the floor of a volume is one plane, and where it only looks like one."""

import manifold3d
import numpy as np
import pytest

from minexplore.floors.volume_arrays import VolumeFacets
from minexplore.volume.flat import FlatFloors

LOW, HIGH = np.array([-1.0, -1.0, -0.5]), np.array([1.0, 1.0, 1.5])
EAST, UP = np.array([1.0, 0, 0]), np.array([0, 0, 2.0])


def hall(slope=0.0, half_m=2.0):
    """Return a hall of 10 x 4 x 3 m whose floor is at no height in its middle, and rises to the east.

    The floor is `half_m` wide to either side, and the roof 2 m.
    """
    sides = [(y, z) for z, half in ((0.0, half_m), (3.0, 2.0)) for y in (-half, half)]
    points = [[x, y, z + x * slope] for x in (-5.0, 5.0) for y, z in sides]
    return manifold3d.Manifold.hull_points(np.array(points))


def box(low, high):
    return manifold3d.Manifold.cube(np.subtract(high, low)).translate(low)


def floors(solid):
    mesh = solid.to_mesh64()
    faces = np.asarray(mesh.tri_verts).astype(np.int32)
    nothing = np.zeros(len(faces), np.int32)
    return FlatFloors(VolumeFacets(np.asarray(mesh.vert_properties)[:, :3], faces, nothing, nothing))


@pytest.mark.parametrize("slope", [0.0, 0.1])
def test_a_floor_of_one_plane_is_found_with_its_slope_and_height(slope):
    found = floors(hall(slope)).within(LOW + EAST, HIGH + EAST)
    assert found.plane == pytest.approx([slope, 0, slope], abs=1e-9)
    assert found.middle_m.tolist() == ([1.0, 0.0] if slope else [0.0, 0.0])  # a level mine has one plane


def test_only_a_mine_whose_floor_is_level_is_level():
    assert floors(hall()).level.plane == pytest.approx(np.zeros(3), abs=1e-12)
    assert floors(hall(0.1)).level is None
    assert floors(hall() + box([0, 0, -1], [1, 1, 1])).level is None


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda solid: solid - box([0.5, -2, -1], [9, 2, 0.01]), id="step of a centimetre"),
        pytest.param(lambda solid: solid + box([0.5, 0.5, -0.3], [0.8, 0.8, 1]), id="hollow"),
        pytest.param(lambda solid: solid + box([0.5, 0.5, -9], [0.8, 0.8, 1]), id="shaft deeper than the box"),
        pytest.param(lambda solid: solid ^ hall(half_m=0.9), id="wall that leans back"),
    ],
)
def test_a_floor_that_turns_goes_down_or_runs_up_a_wall_is_no_plane(change):
    assert floors(change(hall())).within(LOW, HIGH) is None


def test_what_is_out_of_reach_does_not_count():
    solid = hall() + box([3.0, 0.5, -0.3], [4.0, 0.8, 1])
    assert floors(solid).within(LOW, HIGH) is not None
    assert floors(solid).within(LOW + UP, HIGH + UP) is None  # in the air
