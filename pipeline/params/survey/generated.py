"""Mines that are generated from a seed: procedural ones, and variants of another mine."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pipeline.params.base import DataFile, Params
from pipeline.params.survey.base import DrawnSurveyParams
from pipeline.params.survey.values import Range, Share


class MineParams(Params):
    """The shape of a procedural mine; the last three parameters apply to the styles in their descriptions."""

    style: Literal["room_and_pillar", "drift_and_crosscut", "ramp", "cave"] = Field(
        description="pattern of the procedural mine"
    )
    size_m: Range = Field(description="least and greatest side of the mine")
    width_m: Range = Field(description="least and greatest width of a drift")
    loops: Share = Field(description="share of the crosscuts driven in addition to a spanning tree")
    dead_ends: Share = Field(description="share of the possible dead ends that stay dead ends")
    pillar_m: float = Field(ge=3, le=50, description="side of a pillar; style=room_and_pillar")
    spacing_m: float = Field(
        ge=10,
        le=100,
        description="distance between drifts or between a ramp's straights; style=drift_and_crosscut or ramp",
    )
    wander: Share = Field(description="how much passages wind, 0 to 1; style=cave")


class RoughWallsParams(Params):
    """Self-affine roughness of a procedural mine's walls; `rms_m` is over the band from shortest to longest."""

    rms_m: float = Field(gt=0, le=0.5, description="s.d. of the walls' self-affine displacement over all octaves")
    hurst: float = Field(gt=0, le=1, description="Hurst exponent of rough walls: 1 is smooth at small scale")
    shortest_m: float = Field(ge=0.05, le=10, description="shortest wavelength of rough walls")
    longest_m: float = Field(ge=0.1, le=50, description="longest wavelength of rough walls")


class ProceduralSurveyParams(DrawnSurveyParams):
    """A procedural mine, generated from a seed; `as_picture` traces it from its drawing, as a plan's picture is."""

    kind: Literal["procedural"] = Field(description="what the survey is read as")
    seed: int = Field(ge=0, description="seed of the generated mine")
    mine: MineParams = Field(description="the shape of the mine")
    rib_noise_m: float = Field(
        default=0.15, ge=0, le=1, description="standard deviation of the walls about their lines"
    )
    rough_walls: RoughWallsParams | None = Field(
        default=None, description="self-affine roughness of the walls in addition to rib_noise_m; null: none"
    )
    as_picture: bool = Field(
        default=False, description="the workings are traced from their drawing, as a plan's picture is"
    )
    anti_aliased: bool = Field(
        default=True, description="with as_picture: pixels are shaded by the covered share, else by their centres"
    )
    jpeg_quality: int | None = Field(
        default=None,
        ge=30,
        le=100,
        description="with as_picture: JPEG quality of the drawing; null: it is not compressed",
    )


class VariantSurveyParams(DrawnSurveyParams):
    """A random variant of another mine's workings, within the errors of a survey."""

    kind: Literal["variant"] = Field(description="what the survey is read as")
    workings: DataFile = Field(description="free_space.geojson or workings.geojson of the mine")
    seed: int = Field(ge=0, description="seed of the variant")
    station_sd_m: float = Field(
        default=0.3, ge=0, le=5, description="s.d. of each coordinate of a place, correlated over reach_m"
    )
    width_sd_m: float = Field(default=0.1, ge=0, le=1, description="s.d. of the offset of all walls, drawn once")
    reach_m: float = Field(
        default=20.0, gt=0, le=500, description="distance over which the places of a variant move together"
    )
