"""What a bundle states to be made by: the kind of mine, and the values that decide what the builder writes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.params.base import Params, one_of
from pipeline.params.compile3d import COLLISION_METHODS
from pipeline.params.fittings import FittingsParams


class MadeBy(Params):
    """The kind of a mine, which decides its limits, and how its outline, network, collision and fittings are made."""

    kind: Literal["embedded", "own", "heights"] = Field(description="embedded, or a file of conf/mine")
    network_cell_m: float = Field(gt=0.02, le=2)
    network_min_leg_m: float = Field(ge=0, le=50)
    network_station_spacing_m: float = Field(gt=0)
    collision_method: Annotated[str, one_of(COLLISION_METHODS)]
    collision_tile_m: float | None = Field(ge=50, description="side of the tiles that exact parts lie in")
    steepest_deg: float = Field(30.0, gt=0, le=45, description="of a floor with heights")
    fittings: FittingsParams
    tolerance_m: float | None = Field(
        ge=0, description="largest distance by which simplification may have moved a wall; null: 8 x wall_error_m"
    )
    wall_error_m: float = Field(gt=0)
