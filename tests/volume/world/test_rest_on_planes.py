"""Robots at rest on even planes: how steep a floor may be that they are judged on, and what the plane has in it."""

import math

import mujoco
import numpy as np
import pytest

from benchmarks.comparisons.volume.cases import GateCase
from minexplore.physics.husky import HuskyParams
from minexplore.physics.local_models import physics_spec
from minexplore.physics.robot import FLOOR_BIT, RobotParams, stand_on_facets
from minexplore.physics.robot_kind import keep_in_disc
from minexplore.task import TaskParams
from pipeline.volume.floors import solve_floors
from pipeline.volume.shell import build_shell
from pipeline.volume.world.proof.physics import STEEPEST, creep_on_planes, measure_standing
from tests.heights import HEADER


def creep_m(slope: float, heading: float) -> float:
    """Return how far a robot moves in 5 s at rest on a level plane with tilted gravity."""
    robot, steep = RobotParams(), math.atan(slope)
    spec = physics_spec(TaskParams(terrain=False))
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], contype=FLOOR_BIT, conaffinity=0)
    robot.attach(spec, "robot")
    stand_on_facets(spec, "robot")
    model = spec.compile()
    data, g = mujoco.MjData(model), -model.opt.gravity[2]
    model.opt.gravity[:] = -g * math.sin(steep), 0, -g * math.cos(steep)
    data.qpos[:7] = 0, 0, robot.wheel_radius_m, math.cos(heading / 2), 0, 0, math.sin(heading / 2)
    mujoco.mj_step(model, data, round(1 / model.opt.timestep))
    start = data.qpos[:3].copy()
    mujoco.mj_step(model, data, round(5 / model.opt.timestep))
    return float(np.linalg.norm(data.qpos[:3] - start))


def turned_m(slope: float) -> float:
    """Return how far the wheels turn in 5 s under the weight of a robot that stands uphill."""
    robot = RobotParams()
    torque = robot.mass_kg * 9.81 * math.sin(math.atan(slope)) * robot.wheel_radius_m / 2 - robot.wheel_friction_nm
    return max(0.0, torque) / robot.wheel_gain_nms * robot.wheel_radius_m * 5


def standing(slope: float, heading: float) -> np.ndarray:
    """Return the axes (3, 3) of a robot on a plane that rises to the east."""
    steep, c, s = math.atan(slope), math.cos(heading), math.sin(heading)
    tilted = np.array([[math.cos(steep), 0, -math.sin(steep)], [0, 1, 0], [math.sin(steep), 0, math.cos(steep)]])
    return tilted @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def test_on_even_planes_a_robot_rests_up_to_the_steepest_floor_that_is_judged_and_slides_on_steeper_ones():
    headings = np.linspace(0, np.pi, 5)
    assert max(creep_m(STEEPEST, heading) for heading in headings) - turned_m(STEEPEST) < 0.005
    assert max(creep_m(0.35, heading) for heading in headings) - turned_m(0.35) > 0.01


def test_the_creep_that_is_taken_off_is_that_of_a_plane_with_tilted_gravity_and_no_more_than_of_the_steepest():
    cases = [(slope, heading) for slope in (0.0, 0.1, STEEPEST) for heading in (0.0, math.pi / 2, math.pi)]
    planes = creep_on_planes(np.array([standing(*case) for case in cases]))
    np.testing.assert_allclose(planes, [creep_m(*case) for case in cases], atol=2e-4)
    steeper, steepest = creep_on_planes(np.array([standing(0.4, 0.0), standing(STEEPEST, 0.0)]))
    assert steeper == pytest.approx(steepest, abs=1e-4)


def test_a_world_that_is_an_even_ramp_adds_nothing_to_the_creep_of_its_robots(tmp_path):
    rows = "A,1,0,0,2,2,0,3,0\nA,2,30,0,2,2,5.7,3,0\n"  # a rise of 0.19
    network = GateCase("ramp", HEADER + rows).network(tmp_path)
    volume = solve_floors(network)
    assert measure_standing(volume, build_shell(volume), np.random.default_rng(0)).rest_m < 2e-4


@pytest.mark.parametrize("robot", [RobotParams(), RobotParams(wheel_base_m=0.9), HuskyParams()])
def test_wheels_touch_nothing_beyond_the_disc_of_their_robot_and_are_as_high(robot):
    spec = mujoco.MjSpec()
    robot.attach(spec, "robot")
    wheels = [spec.geom(f"robot_{wheel}") for side in robot.SIDES for wheel in side]
    for wheel in wheels:
        keep_in_disc(wheel, robot.radius_m)
    model = spec.compile()
    for geom in (model.geom(wheel.name) for wheel in wheels):
        ahead, beside, _ = np.abs(model.body(int(geom.bodyid[0])).pos)
        tall = geom.size[2] if geom.type == mujoco.mjtGeom.mjGEOM_ELLIPSOID else geom.size[0]
        wide = geom.size[1] if geom.type == mujoco.mjtGeom.mjGEOM_ELLIPSOID else geom.size[0]
        assert tall == robot.wheel_radius_m
        assert np.hypot(ahead, beside + wide) < robot.radius_m + 1e-6 or robot.between_sides_m / 2 > robot.radius_m
        assert wide > 0.03
