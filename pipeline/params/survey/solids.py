"""Solids of workings: triangle meshes of the free space."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pipeline.params.base import DataFile
from pipeline.params.survey.base import DrawnSurveyParams
from pipeline.params.survey.values import PlaceM, Unit


class SolidSurveyParams(DrawnSurveyParams):
    """A triangle mesh round the free space of workings: DXF faces, OBJ, STL, PLY, GLB."""

    kind: Literal["solid"] = Field(description="what the survey is read as")
    file: DataFile = Field(description="the survey's file, below data/")
    layers: list[str] | None = Field(default=None, description="layers or objects that are read; null: all")
    unit: Unit | None = Field(
        default=None, description="unit of the file's coordinates; null: the unit that the file states, or m"
    )
    up: Literal["y", "z"] | None = Field(
        default=None, description="axis of the file that points up; null: y in GLB, z in others"
    )
    origin: PlaceM | None = Field(
        default=None, description="the mine frame's origin in the file's coordinates; null: chosen"
    )
    weld_m: float = Field(default=0.001, gt=0, le=1, description="corners nearer than this are one")
    close_m: float = Field(
        default=10.0, ge=0, le=50, description="holes up to this width are closed: entrances are open in most scans"
    )
    simplify_m: float = Field(
        default=0.001,
        gt=0,
        le=0.5,
        description="the mesh is simplified: up to 1 mm all of it moves by no more than this, else four fifths of it",
    )
