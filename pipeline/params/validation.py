"""Stage 6: what is measured and within which limits it must lie."""

from __future__ import annotations

from typing import Any

from pydantic import Field, field_validator, model_validator

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
    """Limits by metric name and how networks are traced.

    In `conf/` the limits are nested as the metrics are; here a name joins its groups by dots.
    """

    network_cell_m: float = Field(gt=0.02, le=2)
    network_min_leg_m: float = Field(ge=0, le=50)
    limits: dict[str, Limit]

    @field_validator("limits", mode="before")
    @classmethod
    def _join_groups(cls, value: Any) -> Any:
        return _flatten(value) if isinstance(value, dict) else value


def _flatten(groups: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in groups.items():
        nested = isinstance(value, dict) and not set(value) <= {"min", "max"}
        flat |= _flatten(value, f"{prefix}{key}.") if nested else {f"{prefix}{key}": value}
    return flat
