"""Settings of a training run, composed from `conf/train/` and checked."""

from __future__ import annotations

from typing import Literal

from hydra.core.config_store import ConfigStore
from pydantic import Field

from baselines.base.environments import known_ids, short_name
from baselines.base.settings import Settings, compose_checked
from baselines.policies.learned import Model
from minexplore.splits import SIZES


class Stop(Settings):
    """When a run ends before its steps do; coverage is a share of all reachable cells."""

    coverage: float = Field(gt=0, le=1)
    drop: float = Field(gt=0, le=1)
    window: int = Field(ge=1)
    after: int = Field(ge=0)


class Ppo(Settings):
    """PPO's own numbers; `conf/train/config.yaml` gives their sources."""

    lr: float = Field(gt=0)
    lr_end: float | None = Field(default=None, gt=0)
    gamma: float = Field(gt=0, le=1)
    lambda_: float = Field(ge=0, le=1)
    fragment: int = Field(ge=1)
    minibatch: int = Field(ge=1)
    epochs: int = Field(ge=1)
    clip: float = Field(gt=0)
    entropy: float = Field(ge=0)
    value: float = Field(ge=0)
    grad_clip: float = Field(gt=0)
    reward_scale: float = Field(gt=0)
    cell_bonus: float = Field(default=0.0, ge=0)


class TrainSettings(Settings):
    """One run: its environment, observation, network and length."""

    env: str
    mines: int = Field(default=1, ge=1, le=SIZES["train"])
    observation: Literal["beams", "map"]
    model: Model
    seed: int = Field(ge=0)
    steps: int = Field(gt=0)
    checkpoint_every: int = Field(ge=1)
    runners: int = Field(ge=0)
    robots: int = Field(ge=1)
    stop: Stop
    ppo: Ppo

    @property
    def name(self) -> str:
        """Return the run's name: its folder under `artifacts/train`."""
        return f"{short_name(self.env)}-{self.observation}-{self.model.kind}-{self.seed}"


def compose_settings(overrides: list[str]) -> TrainSettings:
    """Compose a run's settings.

    Raises
    ------
    BaselineError
        Naming the override or the value, and what would be valid.
    """
    _offer_environments()
    return compose_checked("config", overrides, TrainSettings)


def _offer_environments() -> None:
    """Make `env=NAME` a choice for every registered environment, beside the files of `conf/train/env`."""
    for env_id in known_ids():
        ConfigStore.instance().store(short_name(env_id), {"env": env_id}, group="env", package="_global_")
