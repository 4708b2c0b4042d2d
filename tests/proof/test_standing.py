"""Robots on the floor of a spiral ramp: they rest, climb, and have one floor zone at one place of the mine."""

import math

import mujoco
import numpy as np

from minexplore.floors.floor import Floor
from minexplore.floors.floor_zones import zoned_box
from minexplore.physics.local_models import physics_spec
from minexplore.physics.robot import FLOOR_BIT, RobotParams, stand_on_facets
from minexplore.task import TaskParams
from pipeline.proof.standing import STEEPEST, turned_m

LIMITS = ("rest_drift_m", "climb_share")


def test_zones_divide_the_box_about_the_sheets_in_their_places():
    triangle = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 8.0, 0.0]])
    floor = Floor(
        np.concatenate([triangle, triangle + np.array([40.0, 0.0, -5.0])]),
        np.array([[0, 1, 2], [3, 4, 5]], np.int32),
        np.array([0, 1], np.int32),
        np.array([[0.0, 0.0], [35.0, 0.0]]),
    )
    assert zoned_box((-1.0, -2.0, 53.0, 11.0), floor) == (-1.0, -2.0, 18.0, 11.0)
    assert zoned_box((-1.0, -2.0, 53.0, 11.0), Floor()) == (-1.0, -2.0, 53.0, 11.0)


def creep_m(slope: float, heading: float) -> float:
    """Return how far a robot moves in 5 s at rest on an even plane, beyond what its wheels turn."""
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
    return float(np.linalg.norm(data.qpos[:3] - start)) - turned_m(robot, np.array(slope), 5.0)


def test_on_even_planes_a_robot_rests_up_to_the_steepest_floor_that_is_judged_and_slides_on_steeper_ones():
    headings = np.linspace(0, np.pi, 5)
    assert max(creep_m(STEEPEST, heading) for heading in headings) < 0.005
    assert max(creep_m(0.3, heading) for heading in headings) > 0.01
