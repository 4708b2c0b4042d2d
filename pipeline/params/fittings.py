"""The visible floor and the furniture of a world."""

from __future__ import annotations

from pydantic import Field

from pipeline.params.base import Params


class FloorParams(Params):
    """The visible floor; see `pipeline.mjcf.floor.cover`."""

    spacing_m: float = Field(
        ge=0.1, le=1, description="distance between the points of the visible floor, before flat parts lose some"
    )
    kept_share: float = Field(gt=0.02, le=1, description="share of the faces that the mesh keeps")
    relief_m: float = Field(ge=0.01, le=0.04, description="mean height above the flat floor")
    bank_m: float = Field(ge=0, le=0.05, description="height of the banks along the ribs")
    bank_width_m: float = Field(gt=0.1, le=5, description="distance from a rib at which its bank has run out")
    gauge_m: float = Field(gt=0.3, le=4, description="distance between two wheel ruts")
    rut_m: float = Field(ge=0, le=0.05, description="depth of a rut")
    rut_width_m: float = Field(gt=0.05, le=1, description="width of a rut")
    puddles: list[str] = Field(description="names of the floor zones with water on them")
    water_m: float = Field(gt=0.005, lt=0.05, description="level of the water above the flat floor")
    seed: int = Field(ge=0, description="seed of the visible floor's noise")


class WeldMeshParams(Params):
    """Weld mesh under the roof; see `pipeline.mjcf.weld_mesh`."""

    aperture_m: float = Field(ge=0.05, le=0.5, description="distance between neighbouring wires")
    wire_m: float = Field(ge=0.002, le=0.03, description="width of a wire")
    spread_deg: float = Field(ge=20, le=60, description="angle between the upright and the edge, seen from 1.7 m")
    from_junction_m: float = Field(ge=2, le=50, description="length of each drift at a junction that has mesh")


class FurnitureParams(Params):
    """Bolts, pipe, cable, duct and weld mesh; see `pipeline.mjcf.furniture`."""

    bolt_spacing_m: float = Field(ge=0.5, le=10, description="distance between rings of bolts")
    bolts: int = Field(ge=1, le=30, description="bolts of a ring")
    bolt_spread_deg: float = Field(gt=0, le=100, description="angle between the upright and the outermost bolt")
    plate_m: float = Field(ge=0.05, le=0.5, description="side of a bolt's plate")
    duct: bool = Field(description="whether a ventilation duct hangs in the main drift")
    duct_side_m: float = Field(ge=-3, le=3, description="place of the duct left of the middle of the main drift")
    weld_mesh: WeldMeshParams | None = Field(None, description="weld mesh at junctions; null: none")


class FittingsParams(Params):
    """The visible floor and the furniture that a world may have; it may have none of either."""

    floor: FloorParams | None = Field(description="the visible floor that a world may have; null: none")
    furniture: dict[str, FurnitureParams] = Field(
        description="the furniture that a world may have, by its name in realism.furnish"
    )
