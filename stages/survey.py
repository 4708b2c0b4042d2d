"""Stage 1: read the survey, draw or load its plan, and determine the plan's scale."""

from __future__ import annotations

import sys

from pipeline.params.survey import SurveyParams
from pipeline.stage import Artifact, Stage, main
from pipeline.store.mine_survey import MineSurvey
from pipeline.survey.load import read_survey, sources


def read_mine(params: SurveyParams) -> dict[str, MineSurvey]:
    """Return the mine as its survey has it."""
    return {"mine": read_survey(params)}


STAGE = Stage(
    name="survey",
    run=read_mine,
    sources=sources,
    reads={},
    writes={"mine": Artifact("survey/mine", MineSurvey)},
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
