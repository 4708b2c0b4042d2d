"""What of a survey in three dimensions is one floor, and what of it is drivable: parameters of stage 1."""

from __future__ import annotations

from pydantic import Field

from pipeline.params.base import Params


class FloorRules(Params):
    """Values that shape the floor of a world; `conf/floors/default.yaml` explains each."""

    steepest_grade: float = Field(
        default=0.364,
        gt=0,
        le=1,
        description="greatest rise over run to drive on: a steeper stated grade is refused, a steeper line is a shaft",
    )
    grade_change: float = Field(
        default=0.005, gt=0, le=0.1, description="greatest change of a leg's stated grade that closes a loop of grades"
    )
    flat_grade: float = Field(
        default=0.10, gt=0, le=1, description="greatest rise over run of a leg in a survey that is built as a flat plan"
    )
    flat_step_m: float = Field(
        default=1.0,
        ge=0,
        le=100,
        description="greatest difference in height of workings that overlap in plan and are one floor",
    )


FLOOR_RULES = FloorRules()
