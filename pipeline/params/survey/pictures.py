"""Surveys that are pictures, or are drawn as one before they are traced."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pipeline.params.base import DataFile, Params
from pipeline.params.survey.base import DrawnSurveyParams, ScaledSurveyParams
from pipeline.params.survey.values import BoxM, BoxPx, Grey


class StationSurveyParams(ScaledSurveyParams):
    """A station survey. It is drawn as a plan and traced like a published plan."""

    kind: Literal["stations"] = Field(description="what the survey is read as")
    stations: DataFile = Field(description="table of stations with distances to the walls, below data/")
    px_per_m: float = Field(gt=0, le=100, description="resolution of the drawing")
    frame_m: BoxM | None = Field(
        default=None,
        description="frame of the drawing in the mine frame: west, south, east, north; null: fits the workings",
    )
    margin_m: float = Field(
        ge=1, description="width of the paper around the workings of the drawing, with frame_m=null"
    )
    drawing_grey: Grey = Field(description="grey value of the workings of the drawing, 0 (black) to 255")


class IgnoredColour(Params):
    """A colour that does not show workings, such as grid lines, water or notes."""

    rgb: tuple[Grey, Grey, Grey] = Field(description="the colour, 0 to 255")
    within: int = Field(
        default=30, ge=0, le=255, description="largest difference of a channel at which a pixel has the colour"
    )


class PlanSurveyParams(ScaledSurveyParams):
    """A plan image: PNG, JPEG, TIFF or a page of a PDF. Workings are filled, or drawn as lines."""

    kind: Literal["plan"] = Field(description="what the survey is read as")
    image: DataFile = Field(description="the plan's picture or PDF, below data/")
    origin_px: tuple[float, float] | None = Field(
        default=None, description="pixel (col, row) of the cropped and turned picture whose centre is the mine's origin"
    )
    max_megapixels: float = Field(gt=0, description="a larger picture is refused")
    page: int = Field(default=1, ge=1, description="page of a PDF")
    dpi: float = Field(default=200.0, ge=36, le=1200, description="resolution of a PDF's page")
    crop_px: BoxPx | None = Field(
        default=None, description="box of the picture that is read: col0, row0, col1, row1; null: all"
    )
    reduction: int = Field(
        default=1,
        ge=1,
        le=8,
        description="read at 1/reduction of its size after cropping; values in px are those of the whole picture",
    )
    turn_deg: float = Field(
        default=0.0, ge=-180, le=180, description="turn of the picture after cropping, counter-clockwise"
    )
    light_on_dark: bool = Field(default=False, description="workings are light on dark paper")
    ignore_colours: list[IgnoredColour] = Field(
        default_factory=list, description="colours that are no workings, each as {rgb, within}"
    )
    workings_only: bool = Field(
        default=False, description="leave out frames, labels, grids and whatever else does not look like workings"
    )
    level: int | None = Field(
        default=None,
        ge=1,
        le=99,
        description="which plan of several on the drawing is read, from 1; null: it shows one",
    )
    line_drawing: bool = Field(default=False, description="walls are drawn as lines that enclose the workings")
    seeds_px: list[tuple[float, float]] = Field(
        default_factory=list, description="places (col, row) inside workings drawn as lines"
    )
    wall_gap_px: float = Field(default=3.0, ge=0, le=200, description="gaps in drawn walls up to this width are closed")


class GridSurveyParams(DrawnSurveyParams):
    """A ROS occupancy grid: `map.yaml` and its image. Its free cells are the workings."""

    kind: Literal["grid"] = Field(description="what the survey is read as")
    map: DataFile = Field(description="the map.yaml of a ROS occupancy grid, below data/")
    unknown_is_free: bool = Field(default=False, description="unknown cells are workings, not rock")
    narrowest_m: float = Field(
        default=0.6,  # the robot is 0.7 m wide
        ge=0,
        le=10,
        description="free places narrower than this are left out, such as rays of a scanner through windows; 0: none",
    )
    thinnest_m: float = Field(
        default=0.3,
        ge=0,
        le=10,
        description="thinner walls are made so thick, and specks smaller than half of it are left out; 0: neither",
    )
