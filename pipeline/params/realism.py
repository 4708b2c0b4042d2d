"""Stage 5: tilt, floor zones and lights."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from minexplore.looks import LOOKS, PLAIN
from pipeline.params.base import Params, one_of
from pipeline.params.fittings import FloorParams, FurnitureParams
from pipeline.params.made_by import MadeBy

Share = Annotated[float, Field(ge=0, le=1)]


class ZoneParams(Params):
    """A floor zone: its colour and its effect on a robot. Zones divide the floor from west to east."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    friction: float = Field(gt=0, le=2, description="sliding friction between floor and wheel")
    command_scale: float = Field(gt=0, le=1, description="share of a commanded speed that the robot reaches")
    speed_noise_mps: float = Field(
        ge=0, le=1, description="s.d. of the noise on the forward speed in each control step"
    )
    rgba: tuple[Share, Share, Share, Share]


class LightParams(Params):
    """Spot lights along the drifts."""

    along: Literal["main_drift", "network"]
    spacing_m: float = Field(gt=0.5)
    height_m: float = Field(gt=0)
    pitch_deg: float = Field(ge=0, le=90)
    cutoff_deg: float = Field(gt=0, le=90)
    count: int | None = Field(None, ge=1, le=100)


class RealismParams(Params):
    """Tilt, floor, friction, lights and looks of the world bundle."""

    tilt_deg: float = Field(ge=-30, le=30)
    entrance_length_m: float = Field(gt=0)
    floor_thickness_m: float = Field(gt=0)
    rock_friction: float = Field(gt=0, le=2)
    zones: list[ZoneParams] = Field(min_length=1)
    lights: LightParams
    fence_openings: bool = Field(True, description="a fence round each opening; false: a robot can fall in")
    look: Annotated[str, one_of(LOOKS)] = Field(PLAIN, description="light, haze and sheen of the rock")
    floor: FloorParams | None = Field(None, description="the visible floor; null: the flat zones alone")
    furnish: Literal["off", "light", "full", "meshed"] = "off"
    furniture: dict[Literal["light", "full", "meshed"], FurnitureParams] = Field(default_factory=dict)
    preview_width_px: int = Field(ge=64, le=4096)
    made_by: MadeBy = Field(description="what the bundle states to be made by")

    @model_validator(mode="after")
    def _fittings_are_known(self) -> RealismParams:
        if (self.floor is not None or self.furnish != "off") and self.look == PLAIN:
            raise ValueError("a visible floor and furniture need a look other than realism.look=plain; choose look=dry")
        if self.furnish != "off" and self.furnish not in self.furniture:
            raise ValueError(f"realism.furnish={self.furnish} needs realism.furniture.{self.furnish}")
        unknown = set(self.floor.puddles if self.floor else ()) - {zone.name for zone in self.zones}
        if unknown:
            raise ValueError(f"realism.floor.puddles: no zone {min(unknown)!r} in realism.zones")
        return self
