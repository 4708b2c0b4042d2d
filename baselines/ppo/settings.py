"""Settings of a training run, composed from `conf/train/` and checked."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import yaml
from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.errors import HydraException, MissingConfigException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from baselines.base.environments import known_ids, short_name
from baselines.base.errors import BaselineError
from baselines.policies.learned import Model
from minexplore.splits import SIZES

CONF = Path("conf/train")


class _StrictSetting(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Stop(_StrictSetting):
    """When a run ends before its steps do; coverage is a share of all reachable cells."""

    coverage: float = Field(gt=0, le=1)
    drop: float = Field(gt=0, le=1)
    window: int = Field(ge=1)
    after: int = Field(ge=0)


class Ppo(_StrictSetting):
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


class TrainSettings(_StrictSetting):
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
    if not (CONF / "config.yaml").is_file():
        raise BaselineError(f"{CONF / 'config.yaml'}: missing; run from the project's root")
    _offer_environments()
    try:
        with initialize_config_dir(str(CONF.resolve()), version_base="1.3"):
            values = OmegaConf.to_container(compose("config", overrides), resolve=True)
        return TrainSettings.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        raise BaselineError(f"{'.'.join(map(str, first['loc']))} = {first['input']!r}: {first['msg']}") from error
    except MissingConfigException as error:
        choice = str(error.missing_cfg_file).replace("/", "=")
        raise BaselineError(f"{choice}: valid choices are {', '.join(error.options or [])}") from error
    except (HydraException, OmegaConfBaseException, yaml.YAMLError, ValueError, TypeError) as error:
        raise BaselineError(f"{' '.join(overrides)}: {str(error).splitlines()[0]}") from error


def _offer_environments() -> None:
    """Make `env=NAME` a choice for every registered environment, beside the files of `conf/train/env`."""
    for env_id in known_ids():
        ConfigStore.instance().store(short_name(env_id), {"env": env_id}, group="env", package="_global_")
