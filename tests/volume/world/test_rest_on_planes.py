"""Robots at rest on even planes: how steep a floor may be that they are judged on."""

import math

import mujoco
import numpy as np

from minexplore.physics.local_models import physics_spec
from minexplore.physics.robot import FLOOR_BIT, RobotParams, stand_on_facets
from minexplore.task import TaskParams
from pipeline.volume.world.proof.physics import STEEPEST


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
    torque = robot.mass_kg * g * math.sin(steep) * robot.wheel_radius_m / 2 - robot.wheel_friction_nm
    turned_m = max(0.0, torque) / robot.wheel_gain_nms * robot.wheel_radius_m * 5
    return float(np.linalg.norm(data.qpos[:3] - start)) - turned_m


def test_on_even_planes_a_robot_rests_up_to_the_steepest_floor_that_is_judged_and_slides_on_steeper_ones():
    headings = np.linspace(0, np.pi, 5)
    assert max(creep_m(STEEPEST, heading) for heading in headings) < 0.005
    assert max(creep_m(0.3, heading) for heading in headings) > 0.01
