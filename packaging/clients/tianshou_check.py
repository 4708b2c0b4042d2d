"""Tianshou: its vector of scalar environments, its collector and PPO by its trainer."""

import gymnasium
import torch
from tianshou.algorithm.modelfree.ppo import PPO
from tianshou.algorithm.modelfree.reinforce import ProbabilisticActorPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv
from tianshou.trainer import OnPolicyTrainerParams
from tianshou.utils.net.common import Net
from tianshou.utils.net.continuous import ContinuousActorProbabilistic, ContinuousCritic

ID = "minexplore:MineXplore/ChileanMineEntrance-v0"


def spread(of_action):
    """Return a normal distribution of commands by its mean and deviation."""
    return torch.distributions.Independent(torch.distributions.Normal(*of_action), 1)


if __name__ == "__main__":
    torch.manual_seed(0)
    env = DummyVectorEnv([lambda: gymnasium.make(ID, max_episode_steps=20)] * 2)
    one = gymnasium.make(ID)
    actor = ContinuousActorProbabilistic(
        preprocess_net=Net(state_shape=one.observation_space.shape, hidden_sizes=[32]),
        action_shape=one.action_space.shape,
    )
    critic = ContinuousCritic(preprocess_net=Net(state_shape=one.observation_space.shape, hidden_sizes=[32]))
    policy = ProbabilisticActorPolicy(actor=actor, dist_fn=spread, action_space=one.action_space)
    algorithm = PPO(policy=policy, critic=critic, optim=AdamOptimizerFactory(lr=1e-3))
    before = torch.cat([p.detach().clone().ravel() for p in actor.parameters()])
    found = algorithm.run_training(
        OnPolicyTrainerParams(
            training_collector=Collector(algorithm, env, VectorReplayBuffer(200, 2)),
            max_epochs=1,
            epoch_num_steps=80,
            collection_step_num_env_steps=80,
            batch_size=40,
            test_collector=None,
            show_progress=False,
            verbose=False,
        )
    )
    after = torch.cat([p.detach().ravel() for p in actor.parameters()])
    assert found.train_step >= 80
    assert found.train_episode >= 2
    assert after.isfinite().all()
    assert (before != after).any()
    print("DummyVectorEnv, Collector, PPO by its trainer")
