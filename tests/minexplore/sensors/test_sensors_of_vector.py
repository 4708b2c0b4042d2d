"""Sensors of many robots: batches of what each robot reads alone, over the ends of episodes, in copies."""

import copy

import gymnasium
import numpy as np
import pytest

from minexplore.envs.env import MineEnv
from minexplore.envs.vector import MineVectorEnv

NAMES = ("vlp-16", "imu", "pose", "odometry", "map", "goal")
NEAR = {"distance_m": (3.0, 6.0)}


def assert_equal(many, alone):
    """Compare a dict of batches with the dicts of single robots."""
    assert list(many) == list(alone[0])
    for name, batch in many.items():
        np.testing.assert_array_equal(batch, [one[name] for one in alone])


def test_batches_hold_what_each_robot_reads_alone_bit_for_bit(small_world):
    given = {"sensors": NAMES, "conditions": "dusty", "goal": NEAR}
    vector, single = MineVectorEnv(2, small_world, **given), [MineEnv(small_world, **given) for _ in range(2)]
    many, _ = vector.reset(seed=3)
    assert vector.observation_space.contains(many)
    assert_equal(many, [env.reset(seed=3 + i)[0] for i, env in enumerate(single)])
    for _ in range(4):
        many = vector.step(np.full((2, 2), 0.3))[0]
        assert_equal(many, [env.step(np.full(2, 0.3))[0] for env in single])
    twin = copy.deepcopy(vector)
    for ours, theirs in zip(vector.step(np.zeros((2, 2)))[:2], twin.step(np.zeros((2, 2)))[:2], strict=True):
        if isinstance(ours, dict):
            assert_equal(ours, [{name: batch[i] for name, batch in theirs.items()} for i in range(2)])
    vector.close()


def test_images_of_many_robots_are_those_of_each_alone(small_world):
    vector = MineVectorEnv(2, small_world, sensors=("depth", "labels"))
    single = [MineEnv(small_world, sensors=("depth", "labels")) for _ in range(2)]
    assert_equal(vector.reset(seed=5)[0], [env.reset(seed=5 + i)[0] for i, env in enumerate(single)])
    assert_equal(
        vector.step(np.full((2, 2), 0.5))[0],
        [env.step(np.full(2, 0.5))[0] for env in single],
    )
    for env in (vector, *single):
        env.close()


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP"])
def test_readings_go_on_over_the_end_of_an_episode(small_world, mode):
    vector = gymnasium.make_vec(
        "MineXplore/World-v0", 2, world=str(small_world), sensors=("pose",), max_episode_steps=2, autoreset_mode=mode
    )
    vector.reset(seed=0)
    for _ in range(4):
        many, _, _, truncated, info = vector.step(np.full((2, 2), 0.5))
        np.testing.assert_allclose(many["pose"][:, [0, 1, 3]], info["pose_m_rad"], atol=1e-5)
        if mode == "SAME_STEP" and truncated.any():
            final = info["final_info"]["pose_m_rad"]
            for i in range(2):
                np.testing.assert_allclose(info["final_obs"][i]["pose"][[0, 1, 3]], final[i], atol=1e-5)
                assert set(info["final_obs"][i]) == {"robot", "pose"}
    vector.close()
