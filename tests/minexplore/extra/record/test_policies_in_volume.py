"""Explorers by name in a world that is one volume take its map of layers, as in other mines with heights."""

import numpy as np

from baselines.policies.policy_lookup import make_policy
from minexplore.envs.env import MineEnv
from minexplore.extra.record.policies import find_drive


def test_an_explorer_by_name_drives_as_the_one_for_mines_with_heights(over):
    env = MineEnv(over)
    drive = find_drive("nearest-frontier", env, 0, lambda observation, beams: np.zeros(2))
    wanted = make_policy("nearest-frontier", 1, env.task, env.robot, heights=True)
    wanted.reset(np.arange(1), np.array([0]))
    observation, info = env.reset(seed=0)
    for _ in range(10):
        rows = {key: np.array([value]) for key, value in info.items()}
        action = drive(observation, info)
        np.testing.assert_array_equal(action, wanted.act(observation[None], rows)[0])
        observation, _, _, _, info = env.step(action)
    env.close()
