"""Rsl-rl: its runner trains PPO on the vector form by the few lines of its `VecEnv` that every simulator writes."""

import gymnasium
import torch
from gymnasium.vector import AutoresetMode
from rsl_rl.env import VecEnv
from rsl_rl.runners import OnPolicyRunner
from tensordict import TensorDict

ID = "minexplore:MineXplore/ChileanMineEntrance-v0"
NETWORK = {"class_name": "MLPModel", "hidden_dims": [32], "activation": "tanh"}
SETTINGS = {
    "num_steps_per_env": 32,
    "save_interval": 1,
    "multi_gpu": None,
    "obs_groups": {"actor": ["own"], "critic": ["own"]},
    "actor": {**NETWORK, "distribution_cfg": {"class_name": "GaussianDistribution", "std_type": "log"}},
    "critic": NETWORK,
    "algorithm": {"class_name": "PPO", "num_learning_epochs": 1, "num_mini_batches": 2},
}


class MineOnTorch(VecEnv):
    """`make_vec` with tensors."""

    num_actions, max_episode_length, device, cfg = 2, 20, "cpu", {}

    def __init__(self, robots):
        """Make the robots."""
        self.num_envs = robots
        self.env = gymnasium.make_vec(ID, robots, max_episode_steps=20, autoreset_mode=AutoresetMode.SAME_STEP)
        self.episode_length_buf = torch.zeros(robots, dtype=torch.long)
        self.seen, _ = self.env.reset(seed=0)
        self.ends = 0

    def get_observations(self):
        """Return what robots observe."""
        return TensorDict({"own": torch.from_numpy(self.seen)}, batch_size=[self.num_envs])

    def step(self, actions):
        """Step the robots."""
        self.seen, reward, terminated, truncated, _ = self.env.step(actions.numpy())
        self.episode_length_buf += 1
        ends = torch.from_numpy(terminated | truncated)
        self.episode_length_buf[ends] = 0
        self.ends += int(ends.sum())
        more = {"time_outs": torch.from_numpy(truncated)}
        return self.get_observations(), torch.from_numpy(reward).float(), ends.long(), more


if __name__ == "__main__":
    torch.manual_seed(0)
    env = MineOnTorch(4)
    runner = OnPolicyRunner(env, SETTINGS)
    policy = runner.alg.get_policy()
    before = torch.cat([p.detach().clone().ravel() for p in policy.parameters()])
    runner.learn(2)
    after = torch.cat([p.detach().ravel() for p in policy.parameters()])
    assert env.ends >= 4 * 3
    assert after.isfinite().all()
    assert (before != after).any()
    print("OnPolicyRunner with PPO on `make_vec`")
