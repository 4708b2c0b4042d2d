"""What tests ask of solved surveys."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from minesurveys.solved.model import SolvedSurvey
from minesurveys.solved_surveys import solve_file
from pipeline.survey.passages.survey_leg import SurveyLeg
from pipeline.survey.solved.plan_view import plan_legs

needs_cavern = pytest.mark.skipif(shutil.which("cavern") is None, reason="Survex is not installed (Debian: survex)")


def write(folder: Path, files: dict[str, str | bytes] | str) -> Path:
    """Write files by their names below a folder, or the text of `a.svx`; return the path of the first."""
    named = {"a.svx": files} if isinstance(files, str) else files
    for name, data in named.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data if isinstance(data, bytes) else data.encode())
    return folder / next(iter(named))


def position_of(survey: SolvedSurvey) -> dict[str, np.ndarray]:
    """Return the position (3,) m of every named station."""
    return {name: survey.positions_m[i] for i, name in enumerate(survey.names) if name}


def read_passages(path: Path, half_width_m: float | None = None) -> tuple[list[SurveyLeg], str | None]:
    """Return the legs of a survey that Survex solves, and its coordinate system."""
    survey = solve_file(path)
    return plan_legs(path, survey, half_width_m), survey.crs
