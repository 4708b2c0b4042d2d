"""What a bundle states to be made by: the kind of mine, and the values that decide what the builder writes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.params.base import Params, one_of
from pipeline.params.compile3d import COLLISION_METHODS
from pipeline.params.fittings import FittingsParams


class MadeBy(Params):
    """The kind of a mine, which decides its limits, and how its outline, network, collision and fittings are made."""

    kind: Literal["embedded", "own", "heights"] = Field(
        description="kind of mine, which decides its limits: embedded, or a file of conf/mine"
    )
    network_cell_m: float = Field(gt=0.02, le=2, description="contours.network.cell_m of the world")
    network_min_leg_m: float = Field(ge=0, le=50, description="contours.network.min_leg_m of the world")
    network_station_spacing_m: float = Field(gt=0, description="contours.network.station_spacing_m of the world")
    collision_method: Annotated[str, one_of(COLLISION_METHODS)] = Field(
        description="compile3d.collision.method of the world: exact parts must be prisms on the outline's corners"
    )
    collision_tile_m: float | None = Field(
        ge=50, description="compile3d.tile_m of the world: longest side of the tiles that exact parts lie in"
    )
    fittings: FittingsParams = Field(description="the visible floor and the furniture that the world may have")
    tolerance_m: float | None = Field(
        ge=0, description="largest distance by which simplification may have moved a wall; null: 8 x wall_error_m"
    )
    wall_error_m: float = Field(
        gt=0, description="contours.wall_error_m of the world: mean distance of the traced wall from the simplified one"
    )
