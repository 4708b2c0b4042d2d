"""Stage 6: what is measured and within which limits it must lie."""

from __future__ import annotations

from pydantic import Field, model_validator

from pipeline.params.base import Params


class Limit(Params):
    """An inclusive bound on one metric."""

    min: float | None = None
    max: float | None = None

    @model_validator(mode="after")
    def _bounds_something(self) -> Limit:
        if self.min is None and self.max is None:
            raise ValueError("a limit needs min or max")
        return self


class ValidationParams(Params):
    """Limits by metric name (dots separate groups) and how networks are traced."""

    network_cell_m: float = Field(gt=0.02, le=2)
    network_min_leg_m: float = Field(ge=0, le=50)
    limits: dict[str, Limit]
