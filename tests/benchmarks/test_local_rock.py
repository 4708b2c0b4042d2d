"""Local models of a volume: planes that stand for the floor under a robot's wheels, and the walls about it."""

import mujoco
import numpy as np
import pytest

from benchmarks.comparisons.volume.choice import boxes_under
from benchmarks.comparisons.volume.contact_planes import NODE_M, REACH_M, FootPlanes, _planes


def disc():
    """Return the places (k, 3) of a plane's disc, the last 1."""
    x, y = np.meshgrid(*[np.arange(-4, 5) * NODE_M] * 2)
    places = np.column_stack([x.ravel(), y.ravel(), np.ones(x.size)])
    return places[np.hypot(*places[:, :2].T) <= REACH_M + 1e-9]


FLAT = np.array([0.1, -0.05, 0.02])
OTHER = np.array([-0.15, 0.2, 0.03])


@pytest.mark.parametrize(
    ("floor", "bend"), [(lambda a, b: a, 0), (np.maximum, 1), (np.minimum, -1)], ids=["plane", "valley", "ridge"]
)
def test_planes_of_a_floor_with_one_crease_or_none_are_found(floor, bend):
    places = disc()
    rise = floor(places @ FLAT, places @ OTHER)[None]
    found = _planes(places, rise, np.ones(rise.shape, bool))[0]
    assert found[6] == bend
    assert found[7] < 1e-6


def test_what_is_rock_counts_for_no_plane():
    places = disc()
    is_free = places[:, 0] < 0.06
    rise = np.where(is_free, places @ FLAT, 0.7)[None]
    found = _planes(places, rise, is_free[None])[0]
    assert found[:3] == pytest.approx(FLAT, abs=1e-6)
    assert found[7] < 1e-6


def test_a_step_down_has_no_planes():
    places = disc()
    rise = np.where(places[:, 0] < 0.06, 0.0, -0.3)[None]
    assert _planes(places, rise, np.ones(rise.shape, bool))[0, 7] > 0.05


@pytest.mark.parametrize(("joined", "bend"), [(np.maximum, 1.0), (np.minimum, -1.0)], ids=["valley", "ridge"])
def test_the_boxes_under_a_foot_have_the_surface_of_its_planes(joined, bend):
    planes = np.array([FLAT, OTHER])
    under = FootPlanes(planes[None, None], np.array([[bend]]), np.array([[[3.0, 4.0]]]), np.zeros((1, 1)))
    places, quaternions = boxes_under(under)
    spec = mujoco.MjSpec()
    for place, quaternion in zip(places[0], quaternions[0], strict=True):
        body = spec.worldbody.add_body(pos=place, quat=quaternion)
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.5, 0.5, 0.25], pos=[0, 0, -0.25])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for place in disc()[::3] + np.array([0.003, 0.001, 0]):
        start, hit = np.array([3 + place[0], 4 + place[1], 2.0]), np.zeros(1, np.int32)
        height = 2.0 - mujoco.mj_ray(model, data, start, np.array([0, 0, -1.0]), None, 1, -1, hit)
        assert height == pytest.approx(joined(place @ FLAT, place @ OTHER), abs=1e-6)
