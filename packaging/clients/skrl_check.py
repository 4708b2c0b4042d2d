"""Skrl: its wrapper of a scalar and of a vector environment, and PPO by its runner."""

import gymnasium
import torch
from skrl.envs.wrappers.torch import wrap_env
from skrl.utils.runner.torch import Runner

ID = "minexplore:MineXplore/ChileanMineEntrance-v0"
LAYERS = [{"name": "net", "input": "OBSERVATIONS", "layers": [32], "activations": "tanh"}]
SETTINGS = {
    "seed": 0,
    "models": {
        "separate": True,
        "policy": {"class": "GaussianMixin", "network": LAYERS, "output": "ACTIONS"},
        "value": {"class": "DeterministicMixin", "network": LAYERS, "output": "ONE"},
    },
    "memory": {"class": "RandomMemory", "memory_size": -1},
    "agent": {
        "class": "PPO",
        "rollouts": 32,
        "learning_epochs": 1,
        "experiment": {"write_interval": 0, "checkpoint_interval": 0},
    },
    "trainer": {
        "class": "SequentialTrainer",
        "timesteps": 64,
        "disable_progressbar": True,
        "close_environment_at_exit": False,
    },
}

if __name__ == "__main__":
    for made in (gymnasium.make(ID), gymnasium.make_vec(ID, 3)):
        env = wrap_env(made)
        observation, _ = env.reset()
        assert observation.shape == (env.num_envs, 19)
        for _ in range(5):
            observation, reward, *_ = env.step(torch.zeros((env.num_envs, 2)))
        assert reward.shape == (env.num_envs, 1)
        env.close()
    runner = Runner(wrap_env(gymnasium.make_vec(ID, 4, max_episode_steps=20)), SETTINGS)
    policy = runner.agent.policy
    before = torch.cat([p.detach().clone().ravel() for p in policy.parameters()])
    runner.run("train")
    after = torch.cat([p.detach().ravel() for p in policy.parameters()])
    assert after.isfinite().all()
    assert (before != after).any()
    print("wrap_env of `make` and of `make_vec`, PPO by its runner")
