"""Stage 3: collision parts of the rock, occupancy and spawn."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import Field

from pipeline.params.base import Params


class ExactParams(Params):
    """An exact convex partition into prisms."""

    method: Literal["exact"]


class CoacdParams(Params):
    """CoACD on tiles of the rock."""

    method: Literal["coacd"]
    tiles: int = Field(ge=1, le=10000)
    threshold: float = Field(ge=0.01, le=1)
    seed: int = Field(ge=0)


class VhacdParams(Params):
    """V-HACD on tiles of the rock."""

    method: Literal["vhacd"]
    tiles: int = Field(ge=1, le=10000)
    resolution: int = Field(ge=10_000, le=100_000_000)
    max_hulls: int = Field(ge=1, le=1024)
    volume_error_percent: float = Field(ge=0, le=100)


CollisionParams = Annotated[ExactParams | CoacdParams | VhacdParams, Field(discriminator="method")]
COLLISION_METHODS = tuple(
    get_args(kind.model_fields["method"].annotation)[0] for kind in get_args(get_args(CollisionParams)[0])
)


class SpawnParams(Params):
    """The region around the entrance where robots start."""

    radius_m: float = Field(gt=0)
    clearance_m: float = Field(gt=0)


class Compile3dParams(Params):
    """Extrusion, decomposition, occupancy and spawn."""

    height_m: float = Field(gt=0.5, le=50)
    steepest_deg: float = Field(30.0, gt=0, le=45, description="of a floor with heights")
    rock_margin_m: float = Field(gt=0, le=100)
    grid_cell_m: float = Field(ge=0.05, le=2)
    tile_m: float | None = Field(ge=50, description="longest side of the tiles that exact parts lie in; null: one tile")
    collision: CollisionParams
    spawn: SpawnParams
