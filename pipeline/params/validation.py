"""Stage 6: measurements and their limits."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from pipeline.params.base import DataFile, Params
from pipeline.params.made_by import MadeBy


class Limit(Params):
    """An inclusive bound on one metric."""

    min: float | None = None
    max: float | None = None

    @model_validator(mode="after")
    def _bounds_something(self) -> Limit:
        if self.min is None and self.max is None:
            raise ValueError("a limit needs min or max")
        return self

    def holds(self, value: float) -> bool:
        """Return whether a value is within the limit; NaN is not."""
        return (self.min is None or value >= self.min) and (self.max is None or value <= self.max)


class TextureReportParams(Params):
    """Sampling of the rock's texture, evenly by area in stretches of the workings, with the paper's added noise."""

    wall_points: int = Field(ge=1000, le=20_000_000)
    roof_points: int = Field(ge=1000, le=20_000_000)
    points_per_m2: float = Field(gt=0, description="upper bound on the density; small mines need fewer points")
    stretches: int = Field(ge=1, le=200, description="of one draw")
    draws: int = Field(ge=1, le=50, description="most; a mine that is too short for them has fewer")
    stretch_radius_m: float = Field(gt=0)
    wall_z_m: tuple[float, float]
    roof_z_m: tuple[float, float]
    noise_normal_m: float = Field(ge=0)
    noise_in_plane_m: float = Field(ge=0)
    seed: int = Field(ge=0)

    @property
    def draw_m(self) -> float:
        """Return the length of drift, m, that the stretches of one draw cover if they do not overlap."""
        return 2 * self.stretch_radius_m * self.stretches


class ReplayParams(Params):
    """Real sweeps to replay in the world, the search for their poses, and the returns that are compared."""

    poses: DataFile | None
    sweeps: dict[str, DataFile] = Field(description="pose number -> sweep file")
    sensor_height_m: float = Field(gt=0)
    scale: tuple[float, float]
    turn_deg: float = Field(gt=0, le=10)
    shift_m: float = Field(gt=0, le=50)
    correction_m: float = Field(gt=0, le=5)
    correction_deg: float = Field(gt=0, le=10)
    register_range_m: float = Field(gt=0)
    max_range_m: float = Field(gt=0)
    max_range_var_m2: float = Field(gt=0)
    min_incidence_deg: float = Field(ge=0, lt=90)

    @model_validator(mode="after")
    def _sweeps_have_poses(self) -> ReplayParams:
        if self.sweeps and self.poses is None:
            raise ValueError("sweeps need poses")
        return self


class CertificateParams(Params):
    """The proof of containment: robot radius, grid of distance queries, number of contacts, and clauses."""

    robot_radius_m: float = Field(gt=0, le=5)
    cell_m: float = Field(gt=0.02, le=1)
    contacts: int = Field(ge=0, description="robot steps in contact with rock; 0: no stress test")
    seed: int = Field(ge=0)
    limits: dict[str, Limit] = Field(description="limit of each figure, by the figure's name; null: no limit")

    @field_validator("limits", mode="before")
    @classmethod
    def _drop_absent(cls, value: Any) -> Any:
        return _flatten(value) if isinstance(value, dict) else value


class ValidationParams(MadeBy):
    """What a world is made by, limits by metric, and how surfaces are sampled.

    In `conf/` the limits are nested like the metrics, and null means no limit. Here, dots join the nested names.
    """

    overlay: Literal["rough", "none"] = Field("rough", description="whether the world must have visible rock")
    extent: Literal["full", "certificate"] = Field(
        "full", description="certificate: the certificate alone, for large families of worlds that were just built"
    )
    robot_height_m: float = Field(gt=0, description="height at which LiDAR and walls are compared")
    texture: TextureReportParams
    replay: ReplayParams
    certificate: CertificateParams
    limits: dict[str, Limit]

    @field_validator("limits", mode="before")
    @classmethod
    def _join_groups(cls, value: Any) -> Any:
        return _flatten(value) if isinstance(value, dict) else value


def _flatten(groups: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in groups.items():
        if value is None:
            continue
        nested = isinstance(value, dict) and not set(value) <= {"min", "max"}
        flat |= _flatten(value, f"{prefix}{key}.") if nested else {f"{prefix}{key}": value}
    return flat
