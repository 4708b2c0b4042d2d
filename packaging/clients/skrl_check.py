"""Skrl: its wrapper of a scalar and of a vector environment."""

import gymnasium
import torch
from skrl.envs.wrappers.torch import wrap_env

ID = "minexplore:MineXplore/ChileanMineEntrance-v0"

if __name__ == "__main__":
    for made in (gymnasium.make(ID), gymnasium.make_vec(ID, 3)):
        env = wrap_env(made)
        observation, _ = env.reset()
        assert observation.shape == (env.num_envs, 19)
        for _ in range(5):
            observation, reward, *_ = env.step(torch.zeros((env.num_envs, 2)))
        assert reward.shape == (env.num_envs, 1)
        env.close()
    print("wrap_env of gymnasium.make and of make_vec")
