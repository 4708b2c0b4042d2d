"""What tests ask of solved surveys."""

from __future__ import annotations

import numpy as np

from pipeline.survey.solved.model import SolvedSurvey


def position_of(survey: SolvedSurvey) -> dict[str, np.ndarray]:
    """Return the position (3,) m of every named station."""
    return {name: survey.positions_m[i] for i, name in enumerate(survey.names) if name}
