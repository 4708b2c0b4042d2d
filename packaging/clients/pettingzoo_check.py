"""PettingZoo's own tests, and a team as a vector of SuperSuit."""

import numpy as np
import supersuit
from pettingzoo.test import parallel_api_test, parallel_seed_test

from minexplore.envs.multi_agent import MineParallelEnv

if __name__ == "__main__":
    parallel_api_test(MineParallelEnv(robots=2, task={"max_steps": 20}), num_cycles=30)
    given = {"task": {"max_steps": 20}, "robot": "husky", "goal": {}, "sensors": ("pose", "goal")}
    parallel_api_test(MineParallelEnv(robots=2, **given), num_cycles=30)
    parallel_seed_test(lambda: MineParallelEnv(robots=2), num_cycles=5)
    vector = supersuit.pettingzoo_env_to_vec_env_v1(MineParallelEnv(robots=3))
    many = supersuit.concat_vec_envs_v1(vector, 2, num_cpus=1, base_class="stable_baselines3")
    observation = many.reset()
    assert observation.shape == (6, 19)
    many.step(np.zeros((6, 2), np.float32))
    print("parallel_api_test, parallel_seed_test, concat_vec_envs_v1")
