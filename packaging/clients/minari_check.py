"""Minari: episodes are collected, and the environment is recovered from the data set."""

import os
import tempfile

os.environ["MINARI_DATASETS_PATH"] = tempfile.mkdtemp()

import gymnasium
from minari import DataCollector

ID = "minexplore:MineXplore/ChileanMineEntrance-v0"

if __name__ == "__main__":
    env = DataCollector(gymnasium.make(ID, max_episode_steps=5), record_infos=True)
    for seed in range(2):
        env.reset(seed=seed)
        while not env.step(env.action_space.sample())[3]:
            pass
    data = env.create_dataset("mine/random-v0", algorithm_name="random")
    assert data.total_steps == 10
    again = data.recover_environment()
    again.reset(seed=0)
    assert again.spec.max_episode_steps == 5
    print("DataCollector with infos, recover_environment")
