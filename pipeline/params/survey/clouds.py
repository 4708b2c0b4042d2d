"""Point clouds of workings, from scanners inside them."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pipeline.params.base import DataFile
from pipeline.params.survey.solids import SurfaceSurveyParams

MOST_VOXEL_M = 2.0


class CloudSurveyParams(SurfaceSurveyParams):
    """Points on the rock round the free space of workings: LAS, LAZ, PLY, PCD, XYZ, or the triangles of a mesh."""

    kind: Literal["cloud"] = Field(description="what the survey is read as")
    trajectory: DataFile | None = Field(
        default=None, description="where the scanner was, in the file's coordinates: rows `time x y z`; null: not known"
    )
    voxel_m: float = Field(
        default=0.2,
        ge=0.02,
        le=MOST_VOXEL_M,
        description="resolution of the surface; gaps of as much between points are bridged",
    )
    colours: bool = Field(default=True, description="the visible rock has the colours of the points, if they have any")
    close_m: float = Field(
        default=3.0,
        ge=0,
        le=50,
        description="unseen parts of the surface up to this width are listed as holes, wider ones as ends or shadows",
    )
    simplify_m: float = Field(
        default=0.03,
        gt=0,
        le=0.5,
        description="the surface is simplified, and four fifths of it move by no more than this",
    )
