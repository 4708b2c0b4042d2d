"""Stage 1: read the survey, draw or load its plan, and determine the plan's scale."""

from __future__ import annotations

import sys

from pipeline.stage import Artifact, Stage, main
from pipeline.survey.load import read_survey, sources
from pipeline.types import ClosedMesh, FloorMesh, Image, Survey, SurveyedLegs, Workings

STAGE = Stage(
    name="survey",
    run=read_survey,
    sources=sources,
    reads={},
    writes={
        "plan": Artifact("survey/plan.png", Image),
        "survey": Artifact("survey/survey.json", Survey),
        "workings": Artifact("survey/workings.geojson", Workings),
        "network": Artifact("survey/network.npz", SurveyedLegs),
        "solid": Artifact("survey/solid.npz", ClosedMesh),
        "floors": Artifact("survey/floors.npz", FloorMesh),
        "level_legs": Artifact("survey/level_legs.npz", SurveyedLegs),
    },
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
