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

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$", description="name of the zone in the bundle")
    friction: float = Field(gt=0, le=2, description="sliding friction between floor and wheel")
    command_scale: float = Field(gt=0, le=1, description="share of a commanded speed that the robot reaches")
    speed_noise_mps: float = Field(
        ge=0, le=1, description="s.d. of the noise on the forward speed in each control step"
    )
    rgba: tuple[Share, Share, Share, Share] = Field(description="colour of the floor and its opacity, 0 to 1")


class LightParams(Params):
    """Spot lights along the drifts."""

    along: Literal["main_drift", "network"] = Field(
        description="drifts with lights: the main drift, or all of the network"
    )
    spacing_m: float = Field(gt=0.5, description="distance between lights along a drift")
    height_m: float = Field(gt=0, description="height of a light above the floor")
    pitch_deg: float = Field(ge=0, le=90, description="angle of a light's axis below the horizontal")
    cutoff_deg: float = Field(gt=0, le=90, description="angle between a light's axis and the edge of its cone")
    count: int | None = Field(
        None, ge=1, le=100, description="most lights of a line of drifts; null: as many as the spacing gives"
    )


class RealismParams(Params):
    """Tilt, floor, friction, lights and looks of the world bundle."""

    tilt_deg: float = Field(
        ge=-30, le=30, description="turn of the whole world about its Y axis; 5 deg is the paper's 0.0872665 rad"
    )
    entrance_length_m: float = Field(
        gt=0, description="length over which the bundle states the rise of the entrance (the paper's 5.2 m over 60 m)"
    )
    floor_thickness_m: float = Field(gt=0, description="thickness of the floor's and the roof's collision boxes")
    rock_friction: float = Field(gt=0, le=2, description="sliding friction of the rock's collision parts")
    zones: list[ZoneParams] = Field(
        min_length=1,
        description="floor zones from west to east, each with name, friction, command_scale, speed_noise_mps, rgba",
    )
    lights: LightParams = Field(description="spot lights along the drifts")
    look: Annotated[str, one_of(LOOKS)] = Field(PLAIN, description="light, haze and sheen of the rock")
    floor: FloorParams | None = Field(None, description="the visible floor; null: the flat zones alone")
    rough_floor: bool = Field(
        False, description="robots stand on the visible floor, with its ruts and banks; false: on level planes"
    )
    furnish: Literal["off", "light", "full", "meshed"] = Field(
        "off", description="furniture of the world, by its name in realism.furniture; needs a look"
    )
    furniture: dict[Literal["light", "full", "meshed"], FurnitureParams] = Field(
        default_factory=dict,
        description="bolts, pipe, cable, duct and weld mesh of each kind of furniture; pipeline/params/fittings.py",
    )
    preview_width_px: int = Field(ge=64, le=4096, description="width of the bundle's preview picture")
    made_by: MadeBy = Field(description="what the bundle states to be made by")

    @model_validator(mode="after")
    def _fittings_are_known(self) -> RealismParams:
        if (self.floor is not None or self.furnish != "off") and self.look == PLAIN:
            raise ValueError("a visible floor and furniture need a look other than realism.look=plain; choose look=dry")
        if self.rough_floor and self.floor is None:
            raise ValueError("realism.rough_floor needs a visible floor (fittings=drift)")
        if self.furnish != "off" and self.furnish not in self.furniture:
            raise ValueError(f"realism.furnish={self.furnish} needs realism.furniture.{self.furnish}")
        unknown = set(self.floor.puddles if self.floor else ()) - {zone.name for zone in self.zones}
        if unknown:
            raise ValueError(f"realism.floor.puddles: no zone {min(unknown)!r} in realism.zones")
        return self
