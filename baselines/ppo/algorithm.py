"""RLlib's PPO built from a run's settings; this module needs Ray and torch."""

from __future__ import annotations

from typing import Any

from ray.rllib.algorithms.algorithm import Algorithm
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.tune.registry import register_env

from baselines.ppo.settings import TrainSettings
from baselines.ppo.training_env import FIGURES, make_training_env

_ENV = "minexplore-training"


def build_algorithm(settings: TrainSettings, steps_done: int) -> Algorithm:
    """Return PPO; `steps_done` is added to the seed, so that a resumed run does not repeat its first episodes."""
    register_env(_ENV, make_training_env)
    seed = settings.seed + steps_done
    context = {
        "env": settings.env,
        "mines": settings.mines,
        "observation": settings.observation,
        "seed": seed,
        "reward_scale": settings.ppo.reward_scale,
        "cell_bonus": settings.ppo.cell_bonus,
    }
    single = make_training_env(context)
    ppo, recurrent = settings.ppo, settings.model.kind == "lstm"
    memory = {"lstm_cell_size": settings.model.cell, "max_seq_len": settings.model.sequence}
    # RLlib 2.60 cannot hold one standard deviation for all steps of a sequence: an LSTM returns it with the mean.
    model = DefaultModelConfig(
        fcnet_hiddens=settings.model.hidden,
        fcnet_activation="tanh",
        vf_share_layers=False,
        free_log_std=not recurrent,
        use_lstm=recurrent,
        **(memory if recurrent else {}),
    )
    rate = ppo.lr if ppo.lr_end is None else [[0, ppo.lr], [settings.steps, ppo.lr_end]]
    config = (
        PPOConfig()
        .environment(
            _ENV,
            env_config=context,
            observation_space=single.single_observation_space,
            action_space=single.single_action_space,
        )
        .env_runners(
            num_env_runners=settings.runners,
            num_envs_per_env_runner=settings.robots,
            rollout_fragment_length=ppo.fragment,
            gym_env_vectorize_mode="vector_entry_point",
        )
        .training(
            lr=rate,
            gamma=ppo.gamma,
            lambda_=ppo.lambda_,
            clip_param=ppo.clip,
            entropy_coeff=ppo.entropy,
            vf_loss_coeff=ppo.value,
            vf_clip_param=float("inf"),
            grad_clip=ppo.grad_clip,
            use_kl_loss=False,
            train_batch_size_per_learner=settings.robots * ppo.fragment * max(1, settings.runners),
            minibatch_size=ppo.minibatch,
            num_epochs=ppo.epochs,
        )
        .rl_module(model_config=model)
        .learners(num_learners=0)
        .callbacks(on_episode_end=log_episode)
        .debugging(seed=seed, log_level="ERROR")
    )
    single.close()
    return config.build_algo()


def log_episode(episode: Any, metrics_logger: Any, **kwargs: Any) -> None:
    """Add an episode's figures to the metrics."""
    last = episode.get_infos(-1)
    for name in FIGURES:
        metrics_logger.log_value(("episodes", name), float(last[name]), reduce="item_series")
