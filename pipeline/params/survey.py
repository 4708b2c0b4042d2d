"""Stage 1: where the plan comes from and how its scale is known."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from pipeline.params.base import Params


def _inside_project(path: str) -> str:
    pure = PurePosixPath(path)
    if pure.is_absolute() or ".." in pure.parts or pure.parts[:1] != ("data",):
        raise ValueError(f"{path!r} is not below data/ (inputs live there and are listed in data/registry.txt)")
    return path


DataFile = Annotated[str, AfterValidator(_inside_project)]
PointM = tuple[float, float]


def _boxed(box: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    if not (box[0] < box[2] and box[1] < box[3]):
        raise ValueError("want west < east and south < north")
    return box


def _rising(limits: tuple[float, float]) -> tuple[float, float]:
    if not 0 < limits[0] < limits[1]:
        raise ValueError("want 0 < low < high")
    return limits


BoxM = Annotated[tuple[float, float, float, float], AfterValidator(_boxed)]
ScaleRange = Annotated[tuple[float, float], AfterValidator(_rising)]


class ScaleParams(Params):
    """How metres are read off the plan."""

    source: Literal["bar", "stated", "poses"]
    bar_image: DataFile | None = None
    bar_box_px: tuple[int, int, int, int] | None = Field(None, description="col0, row0, col1, row1 in the plan")
    bar_length_m: float = Field(100.0, gt=0)
    px_per_m: float | None = Field(None, gt=0, le=1000)


class PosesParams(Params):
    """Surveyed scanner poses and their planar sweeps, from which a scale can be derived."""

    file: DataFile
    sweeps: dict[str, DataFile] = Field(description="pose number -> sweep file")
    scale_range_px_per_m: ScaleRange
    max_range_m: float = Field(gt=0)
    max_range_var_m2: float = Field(gt=0)


class _SurveyParams(Params):
    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,64}$")
    scale: ScaleParams
    poses: PosesParams | None = None
    entrance_m: PointM | None = None
    labels_m: dict[str, PointM] = Field(default_factory=dict)
    resample_width_px: int | None = Field(None, ge=64, le=20000)

    @model_validator(mode="after")
    def _scale_has_its_source(self) -> _SurveyParams:
        if self.scale.source == "stated" and self.scale.px_per_m is None:
            raise ValueError("scale.source=stated needs scale.px_per_m")
        if self.scale.source == "poses" and self.poses is None:
            raise ValueError("scale.source=poses needs poses (file, sweeps)")
        return self


class StationSurveyParams(_SurveyParams):
    """A station survey, drawn as a plan."""

    kind: Literal["stations"]
    stations: DataFile
    px_per_m: float = Field(gt=0, le=100)
    frame_m: BoxM | None = Field(None, description="west, south, east, north")
    margin_m: float = Field(ge=1)
    ink_grey: int = Field(ge=0, le=255)


class PlanSurveyParams(_SurveyParams):
    """A plan image with dark workings on light paper."""

    kind: Literal["plan"]
    image: DataFile
    origin_px: tuple[float, float] | None = Field(
        None, description="pixel (col, row) whose centre is the mine's origin"
    )
    max_megapixels: float = Field(gt=0)


SurveyParams = Annotated[StationSurveyParams | PlanSurveyParams, Field(discriminator="kind")]
