"""Settings of a training run of the graph explorer, composed from `conf/train/graph.yaml` and checked."""

from __future__ import annotations

from pathlib import Path

import yaml
from hydra import compose, initialize_config_dir
from hydra.errors import HydraException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from baselines.base.errors import BaselineError
from baselines.graph.network import Shape
from minexplore.splits import SIZES

CONF = Path("conf/train")


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class StartSettings(_Strict):
    """The imitation of the rule that training begins with."""

    mines: int = Field(ge=1)
    robots: int = Field(ge=2, le=64)
    temperature_m: float = Field(gt=0)
    steps: int = Field(ge=1)
    batch: int = Field(ge=1)
    lr: float = Field(gt=0)


class ImproveSettings(_Strict):
    """The policy gradient."""

    updates: int = Field(ge=0)
    mines: int = Field(ge=1)
    robots: int = Field(ge=2, le=256)
    caves: float = Field(ge=0, le=1)
    discount_s: float = Field(gt=0)
    lr: float = Field(gt=0)
    half_life: float = Field(gt=0)
    clip: float = Field(gt=0, lt=1)
    epochs: int = Field(ge=1)
    entropy: float = Field(ge=0)
    batch: int = Field(ge=1)
    watch_every: int = Field(ge=1)


class GraphSettings(_Strict):
    """One run."""

    name: str = Field(pattern=r"^[A-Za-z0-9._-]{1,48}$")
    seed: int = Field(ge=0)
    mines: int = Field(ge=1, le=SIZES["train"])
    watched: int = Field(ge=0)
    jobs: int = Field(ge=1)
    network: Shape
    start: StartSettings
    improve: ImproveSettings

    @property
    def label(self) -> str:
        """Return the run's name with its seed: its folder under `artifacts/train`."""
        return f"{self.name}-{self.seed}"


def compose_settings(overrides: list[str]) -> GraphSettings:
    """Compose a run's settings.

    Raises
    ------
    BaselineError
        Naming the override or the value, and what would be valid.
    """
    if not (CONF / "graph.yaml").is_file():
        raise BaselineError(f"{CONF / 'graph.yaml'}: missing; run from the project's root")
    try:
        with initialize_config_dir(str(CONF.resolve()), version_base="1.3"):
            values = OmegaConf.to_container(compose("graph", overrides), resolve=True)
        settings = GraphSettings.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        raise BaselineError(f"{'.'.join(map(str, first['loc']))} = {first['input']!r}: {first['msg']}") from error
    except (HydraException, OmegaConfBaseException, yaml.YAMLError, ValueError, TypeError) as error:
        raise BaselineError(f"{' '.join(overrides)}: {str(error).splitlines()[0]}") from error
    if settings.network.width % settings.network.heads:
        raise BaselineError(
            f"network.width = {settings.network.width}: want a multiple of network.heads = {settings.network.heads}"
        )
    return settings
