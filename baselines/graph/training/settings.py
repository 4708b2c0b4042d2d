"""Settings of a training run of the graph explorer, composed from `conf/train/graph.yaml` and checked."""

from __future__ import annotations

from pydantic import Field

from baselines.base.errors import BaselineError
from baselines.base.settings import Settings, compose_checked
from baselines.graph.network import Shape
from minexplore.splits import SIZES


class StartSettings(Settings):
    """The imitation of the rule that training begins with."""

    mines: int = Field(ge=1)
    robots: int = Field(ge=2, le=64)
    temperature_m: float = Field(gt=0)
    steps: int = Field(ge=1)
    batch: int = Field(ge=1)
    lr: float = Field(gt=0)


class ImproveSettings(Settings):
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


class GraphSettings(Settings):
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
    settings = compose_checked("graph", overrides, GraphSettings)
    if settings.network.width % settings.network.heads:
        raise BaselineError(
            f"network.width = {settings.network.width}: want a multiple of network.heads = {settings.network.heads}"
        )
    return settings
