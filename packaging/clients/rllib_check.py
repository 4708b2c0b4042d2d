"""RLlib's new stack: PPO learns from the vector form, and its checkpoint is restored."""

import os
import tempfile

os.environ.update(RAY_USAGE_STATS_ENABLED="0", RAY_DISABLE_IMPORT_WARNING="1")

import gymnasium
import numpy as np
import ray
from ray.rllib.algorithms.ppo import PPO, PPOConfig
from ray.tune.registry import register_env

ID = "minexplore:MineXplore/ChileanMineEntrance-v0"


def make(context):
    """Return the robots of an env runner."""
    return gymnasium.make_vec(ID, context["robots"], max_episode_steps=20)


def weights(algorithm):
    """Return all numbers of the policy."""
    return np.concatenate([array.ravel() for array in algorithm.get_module().get_state().values()])


if __name__ == "__main__":
    ray.init("local", num_cpus=1, include_dashboard=False, log_to_driver=False)
    register_env("mine", make)
    one = gymnasium.make(ID)
    config = (
        PPOConfig()
        .environment(
            "mine", env_config={"robots": 4}, observation_space=one.observation_space, action_space=one.action_space
        )
        .env_runners(
            num_env_runners=0,
            num_envs_per_env_runner=4,
            rollout_fragment_length=32,
            gym_env_vectorize_mode="vector_entry_point",
        )
        .learners(num_learners=0)
        .training(train_batch_size_per_learner=128, minibatch_size=64, num_epochs=1)
        .debugging(seed=0, log_level="ERROR")
    )
    algorithm = config.build_algo()
    before, result = weights(algorithm), algorithm.train()
    after, runners = weights(algorithm), result["env_runners"]
    assert runners["num_env_steps_sampled"] >= 128
    assert runners["num_episodes"] >= 4
    assert np.isfinite(after).all()
    assert (before != after).any()
    with tempfile.TemporaryDirectory() as folder:
        algorithm.save_to_path(folder)
        again = PPO.from_checkpoint(folder)
        assert (weights(again) == after).all()
        again.stop()
    algorithm.stop()
    ray.shutdown()
    print("PPO of the new stack on `make_vec`, checkpoint restored")
