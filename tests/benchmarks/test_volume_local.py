"""Local models of a volume: planes that stand for the floor under a robot's feet, and the walls about it."""

import mujoco
import numpy as np
import pytest

from benchmarks.comparisons.volume.cases import GateCase
from benchmarks.comparisons.volume.local.choice import PlaneChooser, boxes_under
from benchmarks.comparisons.volume.local.drives import VolumeDrive
from benchmarks.comparisons.volume.local.models import PARKED, VolumeModels
from benchmarks.comparisons.volume.local.planes import (
    NODE_M,
    REACHES_M,
    TOLERANCE_M,
    FloorPlanes,
    FootPlanes,
    fit_planes,
)
from minexplore.physics.robot import RobotParams
from pipeline.volume.floors import solve_floors
from pipeline.volume.shell import build_shell
from pipeline.volume.union import pieces_of, unite
from pipeline.volume.world.parts import without_refused
from tests.heights import HEADER

RAMP = "A,1,0,0,1,1,0,3,0\nA,2,20,0,1,1,2,3,0\n"
PITCH = RAMP + "B,2,20,0,1,1,2,3,0\nB,3,20,0,1,1,-10,3,0\nC,3,20,0,2,2,-10,3,0\nC,4,40,0,2,2,-10,3,0\n"
PLANE = np.array([0.1, -0.05, 0.02])
LEVEL_POSE = np.array([0.0, 0, 0, 1, 0, 0, 0])


def built(rows, folder):
    network = GateCase("test", HEADER + rows).network(folder)
    volume = solve_floors(unite(network, pieces_of(network)), network)
    return volume, without_refused(build_shell(volume))[0]


@pytest.fixture(scope="module")
def ramp(tmp_path_factory):
    return built(RAMP, tmp_path_factory.mktemp("ramp"))


def disc():
    """Return the places (k, 2) of a plane's disc, and the heights of a plane there."""
    x, y = np.meshgrid(*[np.arange(-4, 5) * NODE_M] * 2)
    places = np.column_stack([x.ravel(), y.ravel()])
    places = places[np.hypot(*places.T) <= REACHES_M[-1] + 1e-9]
    return places, places @ PLANE[:2] + PLANE[2]


def standing(volume, x, y, models, planes_error=TOLERANCE_M):
    """Return the choice for a robot at rest on the floor under a place."""
    floor = models.planes.floors_under(np.array([[x, y, 50.0]]))[0]
    pose = LEVEL_POSE + np.array([x, y, floor + RobotParams().wheel_radius_m, 0, 0, 0, 0])
    return PlaneChooser(models, planes_error).choose(pose[None], np.zeros((1, 6)))


def test_the_plane_of_a_plane_floor_is_its_own():
    places, rise = disc()
    assert fit_planes(places, rise[None], np.ones((1, len(rise)), bool))[0] == pytest.approx([*PLANE, 0], abs=1e-6)


def test_what_is_rock_counts_for_no_plane():
    places, rise = disc()
    is_free = places[:, 0] < 0.06
    found = fit_planes(places, np.where(is_free, rise, 0.7)[None], is_free[None])[0]
    assert found == pytest.approx([*PLANE, 0], abs=1e-6)


def test_a_floor_with_a_step_is_no_plane():
    places, _ = disc()
    rise = np.where(places[:, 0] < 0.06, 0.0, -0.04)[None]
    assert fit_planes(places, rise, np.ones(rise.shape, bool))[0, 3] > 0.01


def test_the_box_under_a_foot_has_its_plane_as_upper_face():
    under = FootPlanes(PLANE[None, None], np.array([[[3.0, 4.0]]]), np.zeros((1, 1)))
    places, quaternions = boxes_under(under)
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(pos=places[0, 0], quat=quaternions[0, 0])
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.5, 0.5, 0.25], pos=[0, 0, -0.25])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for (x, y), rise in zip(*disc(), strict=True):
        start, hit = np.array([3 + x, 4 + y, 2.0]), np.zeros(1, np.int32)
        height = 2.0 - mujoco.mj_ray(model, data, start, np.array([0, 0, -1.0]), None, 1, -1, hit)
        assert height == pytest.approx(rise, abs=1e-6)


def test_planes_of_a_ramp_have_its_slope_up_to_the_wall_and_none_beyond(ramp):
    planes = FloorPlanes(ramp[0])
    feet = np.array([[[0.0, 0.0], [0.0, 0.97], [0.0, 1.3]]])
    found = planes.under(np.array([[0.0, 0.5, 0.2]]), feet, np.zeros((1, 3)))
    assert found.plane[0, :2, :2] == pytest.approx(np.array([[0.1, 0.0]] * 2), abs=1e-3)
    assert found.heights(feet)[0, :2] == pytest.approx(np.zeros(2), abs=1e-3)
    assert (found.error_m[0, :2] < 1e-4).all()
    assert found.error_m[0, 2] == np.inf


def test_no_places_have_no_floors(ramp):
    assert FloorPlanes(ramp[0]).floors_under(np.zeros((0, 3))).shape == (0,)


def test_a_foot_that_is_too_fast_for_its_plane_has_none(ramp):
    found = FloorPlanes(ramp[0]).under(np.zeros((1, 3)), np.zeros((1, 2, 2)), np.array([[1.9, 2.1]]))
    assert np.isfinite(found.error_m[0]).tolist() == [True, False]


def test_a_robot_on_a_ramp_stands_on_planes_and_one_over_an_edge_on_the_parts(ramp, tmp_path):
    choice = standing(ramp[0], 0.0, 0.0, VolumeModels(*ramp))
    assert choice.tiles[0, 1] == 0
    volume, parts = built(PITCH, tmp_path)
    models = VolumeModels(volume, parts)
    edge = next(x for x in np.arange(-5.0, 2.0, 0.05) if models.planes.floors_under(np.array([[x, 0, 20.0]]))[0] < 0)
    choice = standing(volume, edge - 0.32, 0.0, models)
    assert choice.tiles[0, 1] & 4  # the front foot
    assert choice.places[0, 2] == pytest.approx(PARKED[2])


def test_feet_on_planes_do_not_touch_parts_of_the_floor(ramp):
    model = VolumeModels(*ramp)
    model.number_of(np.array([[0.0, 0.0, 0.2]]), True)
    both = [model.spec(0, feet) for feet in (0, 4)]
    assert [spec.geom("robot_front").conaffinity & 2 for spec in both] == [0, 2]
    assert [spec.geom("robot_left").conaffinity & 2 for spec in both] == [0, 0]


def test_thrown_robots_stay_in_a_drift_and_escape_where_a_wall_is_taken_out(ramp):
    volume, parts = ramp
    found = []
    walls = {k for k, part in enumerate(parts) if np.abs(volume.normals[part.facets[0], 1]) > 1.0}
    for kept in (parts, [part for k, part in enumerate(parts) if k not in walls]):
        drive = VolumeDrive(volume, VolumeModels(volume, kept, fastest_mps=3.0), TOLERANCE_M, np.random.default_rng(0))
        found.append(drive.throw(1, np.random.default_rng(0)))
    assert found[0].touches > 0
    assert found[0].escapes == 0
    assert found[0].floor_error_m < TOLERANCE_M
    assert found[1].escapes > 0
