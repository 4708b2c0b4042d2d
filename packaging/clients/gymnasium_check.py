"""Gymnasium's own checkers, its wrappers, and each way to make a vector."""

import gymnasium
import numpy as np
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

ID = "minexplore:MineXplore/ChileanMineEntrance-v0"

if __name__ == "__main__":
    check_env(gymnasium.make(ID).unwrapped, skip_render_check=True)
    gymnasium.wrappers.TimeAwareObservation(gymnasium.make(ID, max_episode_steps=5)).reset(seed=0)
    for mode in AutoresetMode:
        env = gymnasium.make_vec(ID, 2, max_episode_steps=3, autoreset_mode=mode)
        env.reset(seed=0)
        for _ in range(7):
            *_, truncated, info = env.step(np.zeros((2, 2), np.float32))
            if mode is AutoresetMode.DISABLED and truncated.any():
                env.reset(options={"reset_mask": truncated})
        env.close()
    env = gymnasium.wrappers.vector.NormalizeObservation(gymnasium.make_vec(ID, 2))
    env = gymnasium.wrappers.vector.RecordEpisodeStatistics(env)
    env.reset(seed=1)
    env.step(env.action_space.sample())
    print("check_env, TimeAwareObservation, three autoreset modes, NormalizeObservation, RecordEpisodeStatistics")
