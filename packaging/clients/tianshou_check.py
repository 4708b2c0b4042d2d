"""Tianshou: its vector and its collector."""

import gymnasium
from tianshou.algorithm.random import MARLRandomDiscreteMaskedOffPolicyAlgorithm  # noqa: F401  its packages are there
from tianshou.env import DummyVectorEnv

ID = "minexplore:MineXplore/ChileanMineEntrance-v0"

if __name__ == "__main__":
    env = DummyVectorEnv([lambda: gymnasium.make(ID, max_episode_steps=4)] * 2)
    env.reset()
    for _ in range(4):
        *_, truncated, info = env.step([space.sample() for space in env.action_space])
    assert truncated.all()
    print("DummyVectorEnv")
