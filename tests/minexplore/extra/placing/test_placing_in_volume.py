"""Robots of any MJCF file in mines that are one volume, on its floors, its ramps and in its shafts."""

import math
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import pytest

import minexplore
from minexplore.world import load_world
from tests.minexplore.extra.placing.test_placing import placed

ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
BALL = """<mujoco><worldbody><body name="b"><freejoint/><geom size=".2" name="ball" friction="1 0.1 0.1"/></body>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def over(over):
    return load_world(over)


@pytest.fixture(scope="module")
def ramp(ramp):
    return load_world(ramp)


def height_of(world, data, body="robot/b"):
    return float(data.body(body).xpos[2] - world.T_world_mine[2, 3])


def test_a_robot_stands_on_the_highest_floor_or_on_the_one_under_a_height_that_is_asked_for(over):
    ball = mujoco.MjSpec.from_string(BALL)
    for pose, floor_m in (
        (minexplore.Pose(15.0, 0.0), 8.0),
        (minexplore.Pose(15.0, 0.0, z_m=1.0, stands=True), 0.0),
        (minexplore.Pose(15.0, 0.0, z_m=8.0, stands=True), 8.0),
    ):
        model, data = placed(over, ball, pose)
        start_m = height_of(over, data)
        assert start_m == pytest.approx(floor_m + 0.2, abs=0.01 + 0.005)  # floors follow the survey within 1 cm
        mujoco.mj_step(model, data, nstep=500)
        assert 0 < start_m - height_of(over, data) < 0.01  # it was placed a little over its floor


def test_a_robot_stands_upright_on_a_ramp_and_over_it_where_it_turns(ramp):
    _, data = placed(ramp, ASSETS / "ant.xml", (30.0, 0.0, 0.4))
    up = data.body("robot/torso").xmat.reshape(3, 3)[:, 2]
    np.testing.assert_allclose(up, np.array([-0.15, 0.0, 1.0]) / math.hypot(0.15, 1.0), atol=2e-3)
    for x in (20.0, 40.0):  # where the ramp begins and ends
        _, data = placed(ramp, ASSETS / "ant.xml", (x, 0.0))
        assert min([contact.dist for contact in data.contact[: data.ncon]], default=0.0) > -0.01


def test_a_robot_hovers_level_where_it_is_asked_to_and_the_model_holds_the_rock_within_reach(ramp):
    ball = mujoco.MjSpec.from_string(BALL)
    near, data = placed(ramp, ball, (30.0, 0.0, 0.0, 3.0), reach_m=5.0)
    assert data.ncon == 0
    assert height_of(ramp, data) == pytest.approx(3.2)
    whole, _ = placed(ramp, ball, (30.0, 0.0, 0.0, 3.0), reach_m=math.inf)
    assert near.ngeom < whole.ngeom == len(ramp.volume.parts) + 1


def test_an_ant_that_thrashes_on_a_ramp_stays_in_the_mine(ramp):
    model, data = placed(ramp, ASSETS / "ant.xml", (30.0, 0.0), reach_m=math.inf)
    rng, facets = np.random.default_rng(0), ramp.volume.facets
    root, bodies = model.body("robot/torso").id, np.flatnonzero(model.body_weldid)
    for _ in range(60):
        data.ctrl[:] = rng.uniform(*model.actuator_ctrlrange.T)
        data.xfrc_applied[root, :3] = 12.0 * rng.normal(size=3) * [1.0, 1.0, 0.3]
        mujoco.mj_step(model, data, nstep=10)
        low, high = facets.vertices.min(axis=0), facets.vertices.max(axis=0)
        places = data.xipos[bodies] - ramp.T_world_mine[:3, 3]
        assert ((places > low) & (places < high)).all()
        floor = np.clip((places[:, 0] - 20.0) * 0.15, 0.0, 3.0)
        assert (places[:, 2] > floor - 0.05).all()
    assert [int(warning.number) for warning in data.warning] == [0] * len(data.warning)


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        ((500.0, 0.0), r"pose: \(x, y\) = \(500, 0\): in rock; want a place of the workings"),
        ((30.0, 0.0, 0.0, 0.2), r"pose: \(30\.0, 0\.0, 0\.2\): in rock"),
        ((30.0, 1.9), r"reaches 0\.\d+ m into part_\d+; want a place with"),
    ],
)
def test_a_pose_in_rock_is_refused_in_one_line(ramp, pose, message):
    with pytest.raises(ValueError, match=message) as refused:
        placed(ramp, ASSETS / "ant.xml", pose)
    assert "\n" not in str(refused.value)


def test_what_stands_is_said_by_a_truth_value():
    with pytest.raises(ValueError, match="pose: stands = 'yes': want True or False"):
        minexplore.Pose(1.0, 2.0, z_m=0.0, stands="yes")
