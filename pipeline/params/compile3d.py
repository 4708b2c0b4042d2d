"""Stage 3: collision parts of the rock, occupancy and spawn."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import Field

from pipeline.params.base import Params


class ExactParams(Params):
    """An exact convex partition into prisms."""

    method: Literal["exact"] = Field(
        description="how the rock becomes convex parts: exact partition into prisms, CoACD or V-HACD"
    )


class CoacdParams(Params):
    """CoACD on tiles of the rock."""

    method: Literal["coacd"] = Field(
        description="how the rock becomes convex parts: exact partition into prisms, CoACD or V-HACD"
    )
    tiles: int = Field(
        ge=1, le=10000, description="cells of the grid that cuts the rock before CoACD or V-HACD runs on each"
    )
    threshold: float = Field(
        ge=0.01, le=1, description="CoACD's concavity at which a part is cut no further, as a share of the tile's size"
    )
    seed: int = Field(ge=0, description="seed of CoACD")


class VhacdParams(Params):
    """V-HACD on tiles of the rock."""

    method: Literal["vhacd"] = Field(
        description="how the rock becomes convex parts: exact partition into prisms, CoACD or V-HACD"
    )
    tiles: int = Field(
        ge=1, le=10000, description="cells of the grid that cuts the rock before CoACD or V-HACD runs on each"
    )
    resolution: int = Field(ge=10_000, le=100_000_000, description="V-HACD's number of voxels in a tile")
    max_hulls: int = Field(ge=1, le=1024, description="most convex hulls that V-HACD makes of a tile")
    volume_error_percent: float = Field(
        ge=0, le=100, description="V-HACD cuts a hull no further at this error of its volume, in percent"
    )


CollisionParams = Annotated[ExactParams | CoacdParams | VhacdParams, Field(discriminator="method")]
COLLISION_METHODS = tuple(
    get_args(kind.model_fields["method"].annotation)[0] for kind in get_args(get_args(CollisionParams)[0])
)


class SpawnParams(Params):
    """The region around the entrance where robots start."""

    radius_m: float = Field(gt=0, description="radius of the region around the entrance in which robots start")
    clearance_m: float = Field(gt=0, description="least distance of a start from rock")


class VolumeParams(Params):
    """What a world that is one volume takes where nobody measured, and the robot that its storeys and reach are of."""

    half_width_m: float = Field(
        default=1.0, gt=0, le=20, description="distance to the walls of a shaft that nobody measured"
    )
    roof_m: float | None = Field(
        default=None,
        gt=0.05,
        le=50,
        description="height over the floor of roofs that nobody measured; null: the median of ten or more that were "
        "measured, else compile3d.height_m",
    )
    steepest: float = Field(default=0.364, gt=0, le=1, description="rise over run of the steepest floor of a storey")
    step_m: float = Field(default=0.05, ge=0, le=1, description="highest step that a robot takes")
    robot_height_m: float = Field(default=0.655, gt=0, le=5, description="headroom that a robot needs")
    robot_radius_m: float = Field(default=0.35, gt=0, le=5, description="half the width that a robot needs")


class Compile3dParams(Params):
    """Extrusion, decomposition, occupancy and spawn."""

    height_m: float = Field(gt=0.5, le=50, description="height of the workings, from the floor to the roof")
    rock_margin_m: float = Field(
        gt=0, le=100, description="width of the rock around the workings and around the plan's frame"
    )
    grid_cell_m: float = Field(ge=0.05, le=2, description="cell of the occupancy grid, the Nav2 map and the octree")
    tile_m: float | None = Field(ge=50, description="longest side of the tiles that exact parts lie in; null: one tile")
    collision: CollisionParams = Field(description="how the rock becomes convex parts")
    spawn: SpawnParams = Field(description="where robots start")
    volume: VolumeParams = Field(default_factory=VolumeParams, description="of a survey that is built as one volume")
