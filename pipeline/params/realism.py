"""Stage 5: tilt, floor zones and lights."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from pipeline.params.base import Params

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


class FloorParams(Params):
    """The visible floor; see `pipeline.mjcf.floor_cover`."""

    spacing_m: float = Field(ge=0.1, le=1, description="of the points, before flat parts lose some")
    kept_share: float = Field(gt=0.02, le=1, description="share of the faces that the mesh keeps")
    relief_m: float = Field(ge=0.01, le=0.04, description="mean height above the flat floor")
    bank_m: float = Field(ge=0, le=0.05, description="height of the banks along the ribs")
    bank_width_m: float = Field(gt=0.1, le=5)
    gauge_m: float = Field(gt=0.3, le=4, description="distance between two wheel ruts")
    rut_m: float = Field(ge=0, le=0.05, description="depth of a rut")
    rut_width_m: float = Field(gt=0.05, le=1)
    puddles: list[str] = Field(description="names of the floor zones with water on them")
    water_m: float = Field(gt=0.005, lt=0.05, description="level of the water above the flat floor")
    seed: int = Field(ge=0)


class WeldMeshParams(Params):
    """Weld mesh under the roof; see `pipeline.mjcf.weld_mesh`."""

    aperture_m: float = Field(ge=0.05, le=0.5, description="between neighbouring wires")
    wire_m: float = Field(ge=0.002, le=0.03, description="width of a wire")
    spread_deg: float = Field(ge=20, le=60, description="angle between the upright and the edge, seen from 1.7 m")
    from_junction_m: float = Field(ge=2, le=50, description="length of each drift at a junction that has mesh")


class FurnitureParams(Params):
    """Bolts, pipe, cable, duct and weld mesh; see `pipeline.mjcf.furniture`."""

    bolt_spacing_m: float = Field(ge=0.5, le=10, description="between rings of bolts")
    bolts: int = Field(ge=1, le=30, description="of a ring")
    bolt_spread_deg: float = Field(gt=0, le=100, description="angle between the upright and the outermost bolt")
    plate_m: float = Field(ge=0.05, le=0.5)
    duct: bool
    duct_side_m: float = Field(ge=-3, le=3, description="left of the middle of the main drift")
    weld_mesh: WeldMeshParams | None = Field(None, description="null: none")


class RealismParams(Params):
    """Tilt, floor, friction, lights and looks of the world bundle."""

    tilt_deg: float = Field(ge=-30, le=30)
    entrance_length_m: float = Field(gt=0)
    floor_thickness_m: float = Field(gt=0)
    rock_friction: float = Field(gt=0, le=2)
    zones: list[ZoneParams] = Field(min_length=1)
    lights: LightParams
    fence_openings: bool = Field(True, description="a fence round each opening; false: a robot can fall in")
    look: Literal["plain", "dry", "wet", "dusty"] = Field("plain", description="light, haze and sheen of the rock")
    floor: FloorParams | None = Field(None, description="the visible floor; null: the flat zones alone")
    furnish: Literal["off", "light", "full", "meshed"] = "off"
    furniture: dict[Literal["light", "full", "meshed"], FurnitureParams] = Field(default_factory=dict)
    preview_width_px: int = Field(ge=64, le=4096)

    @model_validator(mode="after")
    def _fittings_are_known(self) -> RealismParams:
        if (self.floor is not None or self.furnish != "off") and self.look == "plain":
            raise ValueError("a visible floor and furniture need a look other than realism.look=plain; choose look=dry")
        if self.furnish != "off" and self.furnish not in self.furniture:
            raise ValueError(f"realism.furnish={self.furnish} needs realism.furniture.{self.furnish}")
        unknown = set(self.floor.puddles if self.floor else ()) - {zone.name for zone in self.zones}
        if unknown:
            raise ValueError(f"realism.floor.puddles: no zone {min(unknown)!r} in realism.zones")
        return self
