"""Local models of a volume: planes that stand for the floor under a robot's feet, and the walls about it."""

import manifold3d
import mujoco
import numpy as np
import pytest

from benchmarks.comparisons.volume.cases import GateCase
from minexplore.floors.volume_arrays import VolumeFacets
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.volume import planes as planes_module
from minexplore.volume.columns import FloorColumns
from minexplore.volume.creases import Creases
from minexplore.volume.flat import plane_quaternions
from minexplore.volume.models import PARKED_M
from minexplore.volume.planes import NODE_M, REACHES_M, TOLERANCE_M, FloorPlanes, FootPlanes, fit_planes
from pipeline.volume.floors import solve_floors
from pipeline.volume.shell import build_shell
from pipeline.volume.world.parts import without_refused
from tests.heights import HEADER
from tests.minexplore.volume.stepping import VolumeDrive, VolumeStepping

RAMP = "A,1,0,0,1,1,0,3,0\nA,2,20,0,1,1,2,3,0\n"
PITCH = RAMP + "B,2,20,0,1,1,2,3,0\nB,3,20,0,1,1,-10,3,0\nC,3,20,0,2,2,-10,3,0\nC,4,40,0,2,2,-10,3,0\n"
PLANE = np.array([0.1, -0.05, 0.02])


def built(rows, folder):
    network = GateCase("test", HEADER + rows).network(folder)
    volume = solve_floors(network)
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


def standing(x, y, local):
    """Return the choice for a robot at rest on the floor under a place, and which feet touch the floor's parts."""
    floor = local.floors_under(np.array([[x, y, 50.0]]))[0]
    place = np.array([[x, y, floor + RobotParams().wheel_radius_m]])
    choice = local.chooser.choose(place, np.eye(3)[None], np.zeros((1, 6)), np.zeros((1, 2), int))
    return choice, int(choice.tiles[0, 1]) & 15


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
    place = [*under.nodes_m[0, 0], under.plane[0, 0, 2]]
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(pos=place, quat=plane_quaternions(under.plane)[0, 0])
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.5, 0.5, 0.25], pos=[0, 0, -0.25])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for (x, y), rise in zip(*disc(), strict=True):
        start, hit = np.array([3 + x, 4 + y, 2.0]), np.zeros(1, np.int32)
        height = 2.0 - mujoco.mj_ray(model, data, start, np.array([0, 0, -1.0]), None, 1, -1, hit)
        assert height == pytest.approx(rise, abs=1e-6)


def test_planes_of_a_ramp_have_its_slope_up_to_the_wall_and_none_beyond(ramp):
    planes = VolumeStepping(*ramp).planes
    feet = np.array([[[0.0, 0.0], [0.0, 0.97], [0.0, 1.3]]])
    found = planes.under(np.array([[0.0, 0.5, 0.2]]), feet, np.zeros((1, 3)))
    assert found.plane[0, :2, :2] == pytest.approx(np.array([[0.1, 0.0]] * 2), abs=1e-3)
    assert found.heights(feet)[0, :2] == pytest.approx(np.zeros(2), abs=1e-3)
    assert (found.error_m[0, :2] < 1e-4).all()
    assert found.error_m[0, 2] == np.inf


def test_no_places_have_no_floors(ramp):
    assert VolumeStepping(*ramp).floors_under(np.zeros((0, 3))).shape == (0,)


def test_a_foot_that_is_too_fast_for_its_plane_has_none(ramp):
    found = VolumeStepping(*ramp).planes.under(np.zeros((1, 3)), np.zeros((1, 2, 2)), np.array([[1.9, 2.1]]))
    assert np.isfinite(found.error_m[0]).tolist() == [True, False]


def bent_floor():
    """Return the facets of a room whose floor begins to rise by 20 % between two samples."""
    floor = [(-2, -2, 0), (0.02, -2, 0), (2, -2, 0.396), (-2, 2, 0), (0.02, 2, 0), (2, 2, 0.396)]
    roof = [(x, y, 3.0) for x in (-2, 2) for y in (-2, 2)]
    mesh = manifold3d.Manifold.hull_points(np.array(floor + roof, float)).to_mesh64()
    faces = np.asarray(mesh.tri_verts).astype(int)
    nothing = np.zeros(len(faces), int)
    return VolumeFacets(np.array(mesh.vert_properties)[:, :3], faces, nothing, nothing)


def test_a_plane_knows_how_far_it_is_from_a_floor_that_turns_between_two_samples():
    facets = bent_floor()
    creases = Creases(facets)
    north = np.linspace(-1.5, 1.5, 30)
    nodes, level = np.column_stack([np.full(30, -0.1), north]), np.tile([0.0, 0.0, 0.0], (30, 1))
    level[:, 2] = north  # the lines of a floor at 0 are so far from level planes at these heights
    assert creases.farthest_m(nodes, level, np.zeros(30), 0.125, 0.2) == pytest.approx(np.abs(north))
    assert (creases.farthest_m(nodes, level, np.zeros(30), 0.115, 0.2) == 0).all()
    assert (creases.farthest_m(nodes, level, np.full(30, 0.3), 0.125, 0.2) == 0).all()
    turn = np.array([[[0.02, 0.0]]])
    foot, speed, body = np.zeros((1, 1, 2)), np.zeros((1, 1)), np.array([[0.0, 0.0, 0.165]])
    found = FloorPlanes(FloorColumns(facets), creases).under(body, foot, speed)
    assert found.error_m[0, 0] >= abs(found.heights(turn)[0, 0]) - 1e-6
    creases._places, creases._square = np.zeros((0, 3)), np.zeros(0, np.int64)
    blind = FloorPlanes(FloorColumns(facets), creases).under(body, foot, speed)
    assert blind.error_m[0, 0] < abs(blind.heights(turn)[0, 0]) - 1e-4


def test_planes_are_the_same_however_many_tiles_were_looked_at_before(ramp, monkeypatch):
    monkeypatch.setattr(planes_module, "_KEPT", 1)
    places = np.array([[-6.0, 0.1, 0.0], [0.1, 0.1, 0.2], [6.0, -0.2, 0.8]])
    places[:, 2] = VolumeStepping(*ramp).floors_under(places + np.array([0, 0, 5.0])) + 0.165
    feet, speed = np.repeat(places[:, None, :2], 2, axis=1), np.full((3, 2), 0.5)
    together = VolumeStepping(*ramp).planes.under(places, feet, speed)
    planes = VolumeStepping(*ramp).planes
    for _ in range(2):  # each tile takes the place of the one before
        for k in range(3):
            alone = planes.under(places[k : k + 1], feet[k : k + 1], speed[k : k + 1])
            assert (alone.plane[0] == together.plane[k]).all()
            assert (alone.error_m[0] == together.error_m[k]).all()


def test_a_robot_on_a_ramp_stands_on_planes_and_one_over_an_edge_on_the_parts(ramp, tmp_path):
    assert standing(0.0, 0.0, VolumeStepping(*ramp))[1] == 0
    local = VolumeStepping(*built(PITCH, tmp_path))
    edge = next(x for x in np.arange(-5.0, 2.0, 0.05) if local.floors_under(np.array([[x, 0, 20.0]]))[0] < 0)
    choice, on_parts = standing(edge - 0.32, 0.0, local)
    assert on_parts & 4  # the front foot
    assert choice.places[0, 2] == pytest.approx(PARKED_M[2])


def test_feet_on_planes_do_not_touch_parts_of_the_floor(ramp):
    models = VolumeStepping(*ramp).models
    models.numbers_of(np.array([[0.0, 0.0, 0.2]]), np.array([True]))
    both = [models.spec((0, feet)) for feet in (0, 4)]
    assert [spec.geom("robot_front").conaffinity & 2 for spec in both] == [0, 2]
    assert [spec.geom("robot_left").conaffinity & 2 for spec in both] == [0, 0]


def test_thrown_robots_stay_in_a_drift_and_escape_where_a_wall_is_taken_out(ramp):
    volume, parts = ramp
    found = []
    walls = {k for k, part in enumerate(parts) if np.abs(volume.normals[part.facets[0], 1]) > 1.0}
    for kept in (parts, [part for k, part in enumerate(parts) if k not in walls]):
        local = VolumeStepping(volume, kept, TaskParams(max_forward_mps=3.0))
        found.append(VolumeDrive(volume, local, np.random.default_rng(0)).throw(1, np.random.default_rng(0)))
    assert found[0].touches > 0
    assert found[0].escapes == 0
    assert found[0].floor_error_m < TOLERANCE_M
    assert found[1].escapes > 0


@pytest.mark.parametrize("feet", [0, 1, 2, 15])
def test_wheels_on_parts_are_no_wider_than_the_robots_disc_and_those_on_planes_are_spheres(ramp, feet):
    models = VolumeStepping(*ramp).models
    models.numbers_of(np.array([[0.0, 0.0, 0.2]]), np.array([True]))
    model, robot = models.spec((0, feet)).compile(), RobotParams()
    for bit, side in enumerate(("left", "right")):
        wheel = model.geom(f"robot_{side}")
        beside_m = float(wheel.size[1] or wheel.size[0]) + robot.wheel_base_m / 2
        assert (beside_m < robot.radius_m + 1e-6) == bool(feet >> bit & 1)
        assert wheel.size[0] == robot.wheel_radius_m
