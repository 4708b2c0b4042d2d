"""What all surveys share: the scale, poses and sweeps, the entrance, heights, and the drawing."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from pipeline.params.base import DataFile, Params
from pipeline.params.floor_rules import FloorRules
from pipeline.params.survey.values import GRADES_NEED, Grade, Grey, PointM, Range, StartM


class ScaleParams(Params):
    """The source of the plan's scale."""

    source: Literal["bar", "stated", "poses", "georeference"] = Field(
        description="source of the scale: the scale bar, px_per_m, poses with sweeps, or the georeference"
    )
    bar_image: DataFile | None = Field(
        default=None,
        description="picture of the scale bar alone, below data/; null: the bar is in the plan, or there is none",
    )
    bar_box_px: tuple[int, int, int, int] | None = Field(
        default=None, description="box of the scale bar in the plan: col0, row0, col1, row1"
    )
    bar_length_m: float = Field(default=100.0, gt=0, description="length that the scale bar represents")
    px_per_m: float | None = Field(
        default=None,
        gt=0,
        le=1000,
        description="the scale with source=stated; else it is compared with the scale that is used",
    )


class PosesParams(Params):
    """Surveyed scanner poses and their planar sweeps, which determine a scale."""

    file: DataFile = Field(description="table of the surveyed scanner poses, below data/")
    sweeps: dict[str, DataFile] = Field(description="file of the planar sweep of each pose, by the pose's number")
    scale_range_px_per_m: Range = Field(description="least and greatest scale that is searched")
    max_range_m: float = Field(gt=0, description="longer returns are dropped")
    max_range_var_m2: float = Field(
        gt=0, description="returns with a larger variance of range are dropped: they straddle an edge"
    )


class BaseSurveyParams(FloorRules):
    """What every survey has: a name, an entrance, labels, and optionally poses, heights or a grade."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,64}$", description="name of the mine and of its world")
    poses: PosesParams | None = Field(default=None, description="surveyed poses with planar sweeps; null: none")
    correct: Literal["sweeps"] | None = Field(
        default=None,
        description="sweeps: stage 2 corrects walls by the sweeps of poses (docs/adr/0015); null: it does not",
    )
    entrance_m: StartM | None = Field(
        default=None,
        description="where robots start, m, mine frame, with the elevation where drifts pass over others; null: chosen",
    )
    labels_m: dict[str, PointM] = Field(
        default_factory=dict,
        description="texts that are written on the drawing, each with its centre in the mine frame; "
        "what a text covers of the workings becomes rock",
    )
    grade: Grade | None = Field(
        default=None,
        description="rise over run of the floor along the drifts, away from the entrance; with a station table also "
        "{leg: grade}, in the order of the leg's stations",
    )
    heights: DataFile | None = Field(
        default=None,
        description="heights of the floor in the coordinates of the survey's file: CSV of easting_m, northing_m, "
        "elevation_m; GeoTIFF; contour lines, points or labels",
    )

    @model_validator(mode="after")
    def _heights_have_one_source(self) -> BaseSurveyParams:
        if self.grade is not None and self.heights is not None:
            raise ValueError("give grade or heights, not both")
        return self

    @model_validator(mode="after")
    def _legs_with_grades_have_names(self) -> BaseSurveyParams:
        table = str(getattr(self, "stations", getattr(self, "file", "")))
        if isinstance(self.grade, dict) and not table.lower().endswith(".csv"):
            raise ValueError(f"grade: {GRADES_NEED}")
        return self

    @model_validator(mode="after")
    def _correction_has_sweeps(self) -> BaseSurveyParams:
        if self.correct is not None and (self.poses is None or not self.poses.sweeps):
            raise ValueError("correct=sweeps needs poses (file, sweeps)")
        return self


class ScaledSurveyParams(BaseSurveyParams):
    """A survey that is a picture with a scale."""

    scale: ScaleParams = Field(description="the source of the scale")
    resample_width_px: int | None = Field(
        default=None, ge=64, le=20000, description="width that the picture is resampled to; null: its own"
    )

    @model_validator(mode="after")
    def _scale_has_its_source(self) -> ScaledSurveyParams:
        if self.scale.source == "stated" and self.scale.px_per_m is None:
            raise ValueError("scale.source=stated needs scale.px_per_m")
        if self.scale.source == "poses" and self.poses is None:
            raise ValueError("scale.source=poses needs poses (file, sweeps)")
        return self


class DrawnSurveyParams(BaseSurveyParams):
    """A survey in metres. Its workings stay vectors; a drawing serves only the pictures and the IoU."""

    px_per_m: float | None = Field(
        default=None,
        gt=0,
        le=100,
        description="resolution of the drawing; null: 8 px/m, less if a side would exceed 6,000 px",
    )
    margin_m: float = Field(
        default=6.0, ge=1, le=100, description="width of the paper around the workings of the drawing"
    )
    drawing_grey: Grey = Field(default=40, description="grey value of the workings of the drawing, 0 (black) to 255")


class FileSurveyParams(DrawnSurveyParams):
    """A survey in metres that is read from a file."""

    file: DataFile = Field(description="the survey's file, below data/")
