"""Surveys in metres: vector files, stations with passages, and centrelines."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from minesurveys.frames import Unit
from pipeline.params.survey.base import FileSurveyParams
from pipeline.params.survey.values import Columns, Elevation, PieceOption, PlaceM, PointM

_ORIGIN = Field(default=None, description="the mine frame's origin in the file's coordinates; null: chosen if needed")


class LayeredSurveyParams(FileSurveyParams):
    """A vector file: DXF, GeoJSON, GeoPackage, Shapefile. Its layers, its coordinates, and its levels."""

    layers: list[str] | None = Field(default=None, description="layers that are read; null: all")
    unit: Unit | None = Field(
        default=None, description="unit of the file's coordinates; null: the unit that the file states"
    )
    origin: PointM | None = _ORIGIN
    elevations_m: dict[str, Elevation] | None = Field(
        default=None,
        description="elevation of the floor of each layer that is a level, m; null: as the file states them",
    )
    level_by: str | None = Field(
        default=None,
        min_length=1,
        max_length=200,
        description="property of the shapes that names their level, as a layer does; null: none",
    )
    no_elevation: float | None = Field(
        default=None,
        description="elevation in the file that stands for none: such points get heights from their line; null: none",
    )


class VectorSurveyParams(LayeredSurveyParams):
    """A vector file with workings as polygons or walls as lines."""

    kind: Literal["vector"] = Field(description="what the survey is read as")
    snap_m: float = Field(default=0.25, ge=0, le=10, description="open ends of walls nearer than this are joined")
    piece: PlaceM | None = Field(
        default=None,
        description="a place (m, mine frame) in the piece of levels and ramps that is built; null: the largest piece",
    )
    seeds_m: list[PointM] = Field(
        default_factory=list, description="places inside the workings; none: the workings are what the walls enclose"
    )


class CentrelineSurveyParams(LayeredSurveyParams):
    """A vector file with centrelines of drifts of one width, in plan or in three dimensions."""

    kind: Literal["centrelines"] = Field(description="what the survey is read as")
    half_width_m: float = Field(gt=0, le=20, description="half the width of every drift")
    snap_m: float = Field(default=0.25, ge=0, le=10, description="an end nearer than this to another line joins it")
    piece: PieceOption | None = Field(
        default=None,
        description="a station or a place (m, mine frame) of the piece that is built; null: the longest piece",
    )


class PassageSurveyParams(FileSurveyParams):
    """Stations with the distances to their walls: the project's CSV, Survex .svx, Compass .plt from Therion."""

    kind: Literal["passages"] = Field(description="what the survey is read as")
    origin: PointM | None = _ORIGIN
    half_width_m: float | None = Field(
        default=None,
        gt=0,
        le=20,
        description="distance to a wall that nobody measured; null: half the median width of the survey's own stations",
    )
    declination_deg: float | None = Field(
        default=None,
        ge=-180,
        le=180,
        description="magnetic declination in place of those that Survex computes, deg east of true north; null: these",
    )
    columns: Columns | None = Field(
        default=None,
        description="columns of a station table with other names: ours, such as easting_ft, and the table's, or its "
        "number where the table has no names; null: by their names",
    )
    piece: PieceOption | None = Field(
        default=None,
        description="a station of the piece that is built, by its name or by its place in the coordinates of "
        "the survey, m; null: the longest piece",
    )
