"""Every element of a robot's file that holds a pose in the world goes with the robot."""

import warnings

import mujoco
import numpy as np
import pytest

import minexplore
from tests.mines import BuiltMine

ROBOT = """<mujoco><worldbody>
<body name="arm" pos="0 0 0.5"><freejoint/><geom size="0.1" mass="1"/></body>
<body name="target" mocap="true" pos="1 0 1"><geom size="0.05" contype="0" conaffinity="0"/></body>
<camera name="eye" pos="0.5 0 1" mode="targetbody" target="arm"/>
</worldbody>
<equality>{ties}</equality>
<keyframe><key name="home" qpos="0 0 0.5 1 0 0 0" mpos="0.2 0.1 0.7" mquat="0.6 0.8 0 0"/></keyframe></mujoco>"""
POSE = (20.0, 2.5, 1.0)
TIES = [
    '<weld body1="arm" body2="world"/>',
    '<weld body1="arm"/>',
    '<weld body1="world" body2="arm"/>',
    '<weld body1="arm" body2="world" relpose="0 0 -0.5 1 0 0 0"/>',
    '<weld body1="arm" relpose="0 0 -0.5 1 0 0 0"/>',
    '<weld body1="world" body2="arm" relpose="0 0 0.5 1 0 0 0"/>',
    '<weld body1="arm" body2="world" anchor="0 0 0.6"/>',
    '<connect body1="arm" body2="world" anchor="0 0 0.1"/>',
    '<connect body1="arm" anchor="0 0 0.1"/>',
    '<connect body1="world" body2="arm" anchor="0 0 0.6"/>',
]


def placed(tee, ties=""):
    """Return the model and data at the spawn, and the transform that the robot's body went through."""
    own = mujoco.MjModel.from_xml_string(ROBOT.format(ties=ties))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        spec = mujoco.MjSpec.from_string(ROBOT.format(ties=ties))
        model = minexplore.place(tee.bundle, spec, POSE).compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("spawn").id)
    mujoco.mj_forward(model, data)
    before = mujoco.MjData(own)
    mujoco.mj_resetDataKeyframe(own, before, 0)
    mujoco.mj_forward(own, before)
    return model, data, own, before


def seen_from(data, one, other):
    """Return the place and the axes of a body in another's frame."""
    axes = data.body(other).xmat.reshape(3, 3)
    return axes.T @ (data.body(one).xpos - data.body(other).xpos), axes.T @ data.body(one).xmat.reshape(3, 3)


def test_a_mocap_body_of_a_keyframe_stands_beside_the_robot_as_in_its_file(tee: BuiltMine):
    _, data, _, before = placed(tee)
    for found, want in zip(
        seen_from(data, "robot/target", "robot/arm"), seen_from(before, "target", "arm"), strict=True
    ):
        np.testing.assert_allclose(found, want, atol=1e-6)


@pytest.mark.parametrize("tie", TIES)
def test_a_robot_that_is_tied_to_the_world_is_tied_where_it_stands(tee: BuiltMine, tie):
    model, data, own, _ = placed(tee, tie)
    assert model.neq == own.neq == 1
    assert np.abs(data.efc_pos[: 3 if "connect" in tie else 6]).max() < 1e-5
    start = data.body("robot/arm").xpos.copy()
    for _ in range(200):
        mujoco.mj_step(model, data)
    assert np.linalg.norm(data.body("robot/arm").xpos - start) < 0.25  # a connect lets it swing by its 0.1 m
    if "weld" in tie:
        assert np.linalg.norm(data.body("robot/arm").xpos - start) < 0.01


def test_a_camera_looks_at_its_target_from_where_the_robot_stands(tee: BuiltMine):
    model, data, _, before = placed(tee)
    eye = data.camera("robot/eye")
    assert np.linalg.norm(eye.xpos - data.body("robot/arm").xpos) == pytest.approx(
        np.linalg.norm(before.camera("eye").xpos - before.body("arm").xpos), abs=1e-6
    )
    assert model.camera("robot/eye").targetbodyid[0] == model.body("robot/arm").id
