"""Stage 1: the source of the survey and of its scale."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pipeline.params.survey.base import PosesParams
from pipeline.params.survey.clouds import MOST_VOXEL_M, CloudSurveyParams
from pipeline.params.survey.generated import ProceduralSurveyParams, VariantSurveyParams
from pipeline.params.survey.pictures import GridSurveyParams, PlanSurveyParams, StationSurveyParams
from pipeline.params.survey.solids import SolidSurveyParams
from pipeline.params.survey.values import GRADES_NEED, BoxPx, Columns, Elevation, Grade, Grey, PieceOption, StartM
from pipeline.params.survey.vectors import CentrelineSurveyParams, PassageSurveyParams, VectorSurveyParams

SurveyParams = Annotated[
    StationSurveyParams
    | PlanSurveyParams
    | VectorSurveyParams
    | PassageSurveyParams
    | CentrelineSurveyParams
    | GridSurveyParams
    | SolidSurveyParams
    | CloudSurveyParams
    | ProceduralSurveyParams
    | VariantSurveyParams,
    Field(discriminator="kind"),
]

__all__ = [
    "GRADES_NEED",
    "MOST_VOXEL_M",
    "BoxPx",
    "CentrelineSurveyParams",
    "CloudSurveyParams",
    "Columns",
    "Elevation",
    "Grade",
    "Grey",
    "GridSurveyParams",
    "PassageSurveyParams",
    "PieceOption",
    "PlanSurveyParams",
    "PosesParams",
    "ProceduralSurveyParams",
    "SolidSurveyParams",
    "StartM",
    "StationSurveyParams",
    "SurveyParams",
    "VariantSurveyParams",
    "VectorSurveyParams",
]
