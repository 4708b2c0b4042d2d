"""Stable-Baselines3: its checker, PPO, SAC and VecNormalize."""

import gymnasium
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

from minexplore.extra.sb3 import MineVecEnv

ID = "minexplore:MineXplore/ChileanMineEntrance-v0"

if __name__ == "__main__":
    check_env(gymnasium.make(ID), skip_render_check=True)
    env = VecNormalize(VecMonitor(MineVecEnv(ID, 4, max_episode_steps=40)))
    PPO("MlpPolicy", env, n_steps=64, batch_size=64, n_epochs=1, seed=0).learn(512)
    SAC("MlpPolicy", gymnasium.make(ID), learning_starts=20, buffer_size=200, seed=0).learn(40)
    print("check_env, PPO, SAC, VecNormalize")
