"""Surveys of the rock's surface, and those that are solids: triangle meshes of the free space."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from minesurveys.frames import Unit
from pipeline.params.survey.base import FileSurveyParams
from pipeline.params.survey.values import PlaceM


class SurfaceSurveyParams(FileSurveyParams):
    """A surface round the free space of workings, in the coordinates of its file."""

    unit: Unit | None = Field(
        default=None, description="unit of the file's coordinates; null: the unit that a file of a solid states, or m"
    )
    up: Literal["y", "z"] | None = Field(
        default=None, description="axis of the file that points up; null: y of a solid in GLB, else z"
    )
    origin: PlaceM | None = Field(
        default=None, description="the mine frame's origin in the file's coordinates; null: chosen"
    )


class SolidSurveyParams(SurfaceSurveyParams):
    """A triangle mesh round the free space of workings: DXF faces, OBJ, STL, PLY, GLB."""

    kind: Literal["solid"] = Field(description="what the survey is read as")
    layers: list[str] | None = Field(default=None, description="layers or objects that are read; null: all")
    weld_m: float = Field(default=0.001, gt=0, le=1, description="corners nearer than this are one")
    close_m: float = Field(
        default=10.0, ge=0, le=50, description="holes up to this width are closed: entrances are open in most scans"
    )
    simplify_m: float = Field(
        default=0.001,
        gt=0,
        le=0.5,
        description="a mesh of more than 20,000 facets is simplified, no corner of it by more than this; beyond 1 mm "
        "any mesh is, and four fifths of it move by no more than this",
    )
