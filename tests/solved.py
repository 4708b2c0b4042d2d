"""What tests ask of solved surveys."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from minesurveys.solved.model import SolvedSurvey
from minesurveys.solved_surveys import solve_file
from pipeline.survey.passages.survey_leg import SurveyLeg
from pipeline.survey.solved.plan_view import plan_legs


def position_of(survey: SolvedSurvey) -> dict[str, np.ndarray]:
    """Return the position (3,) m of every named station."""
    return {name: survey.positions_m[i] for i, name in enumerate(survey.names) if name}


def read_passages(path: Path, half_width_m: float | None = None) -> tuple[list[SurveyLeg], str | None]:
    """Return the legs of a survey that Survex solves, and its coordinate system."""
    survey = solve_file(path)
    return plan_legs(path, survey, half_width_m), survey.crs
