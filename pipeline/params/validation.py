"""Stage 6: measurements and their limits."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from pipeline.params.base import DataFile, Params
from pipeline.params.compile3d import VolumeParams
from pipeline.params.made_by import MadeBy


class Limit(Params):
    """An inclusive bound on one metric."""

    min: float | None = Field(None, description="least value; null: unbounded")
    max: float | None = Field(None, description="greatest value; null: unbounded")

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

    wall_points: int = Field(ge=1000, le=20_000_000, description="most points on the walls of one draw")
    roof_points: int = Field(ge=1000, le=20_000_000, description="most points on the roof of one draw")
    points_per_m2: float = Field(gt=0, description="greatest density of points; small mines need fewer")
    stretches: int = Field(ge=1, le=200, description="stretches of drift in one draw")
    draws: int = Field(ge=1, le=50, description="most draws whose mean is given; a short mine has fewer")
    widest_spacing_m: float = Field(
        gt=0, description="distance of points, where the walls are finest, up to which texture and relief are judged"
    )
    stretch_radius_m: float = Field(gt=0, description="radius of a stretch around its place on the drift")
    wall_z_m: tuple[float, float] = Field(
        description="heights above the floor between which wall points count (the paper's)"
    )
    roof_z_m: tuple[float, float] = Field(description="heights above the floor between which roof points count")
    noise_normal_m: float = Field(
        ge=0, description="s.d. of the noise across the surface that is added to points, as in the paper"
    )
    noise_in_plane_m: float = Field(
        ge=0, description="s.d. of the noise along the surface that is added to points, as in the paper"
    )
    seed: int = Field(ge=0, description="seed of the points and their noise")

    @property
    def draw_m(self) -> float:
        """Return the length of drift, m, that the stretches of one draw cover if they do not overlap."""
        return 2 * self.stretch_radius_m * self.stretches


class ReplayParams(Params):
    """Real sweeps to replay in the world, the search for their poses, and the returns that are compared."""

    poses: DataFile | None = Field(description="table of the surveyed poses whose sweeps are replayed; null: no replay")
    sweeps: dict[str, DataFile] = Field(description="pose number -> sweep file")
    sensor_height_m: float = Field(gt=0, description="height of the scanner above the floor")
    scale: tuple[float, float] = Field(description="least and greatest scale of the survey in this world")
    turn_deg: float = Field(gt=0, le=10, description="greatest turn of all poses together")
    shift_m: float = Field(gt=0, le=50, description="greatest shift of all poses together")
    correction_m: float = Field(gt=0, le=5, description="greatest shift of a single sweep")
    correction_deg: float = Field(gt=0, le=10, description="greatest turn of a single sweep")
    register_range_m: float = Field(gt=0, description="longest return that places a sweep")
    max_range_m: float = Field(gt=0, description="longest return that is compared with the world")
    max_range_var_m2: float = Field(
        gt=0, description="returns with a larger variance of range are dropped: they straddle an edge"
    )
    min_incidence_deg: float = Field(
        ge=0, lt=90, description="returns at a smaller angle between beam and wall are not compared"
    )

    @model_validator(mode="after")
    def _sweeps_have_poses(self) -> ReplayParams:
        if self.sweeps and self.poses is None:
            raise ValueError("sweeps need poses")
        return self


class CertificateParams(Params):
    """The proof of containment: robot radius, grid of distance queries, number of contacts, and clauses."""

    robot_radius_m: float = Field(gt=0, le=5, description="radius of the robot that must fit through")
    cell_m: float = Field(gt=0.02, le=1, description="distance between the places where clearance is measured")
    contacts: int = Field(ge=0, description="robot steps in contact with rock; 0: no stress test")
    seed: int = Field(ge=0, description="seed of the stress test and of the robots at rest")
    limits: dict[str, Limit] = Field(description="limit of each figure, by the figure's name; null: no limit")

    @field_validator("limits", mode="before")
    @classmethod
    def _drop_absent(cls, value: Any) -> Any:
        return _flatten(value) if isinstance(value, dict) else value


class VolumeProofParams(Params):
    """The certificate of a world that is one volume: how much is measured, and the limit of each figure."""

    height_m: float = Field(default=3.5, gt=0.5, le=50, description="height of passages whose roof nobody measured")
    volume: VolumeParams = Field(default_factory=VolumeParams, description="what the world was made with")
    arch_rise_m: float = Field(default=0.9, gt=0, description="how much lower drawn roofs are seen at their walls")
    arch_half_span_m: float = Field(default=2.75, gt=0, description="distance from walls at which these are as drawn")
    compiled: int = Field(default=500, ge=1, description="most collision parts whose compiled hull is measured")
    most_parts: int = Field(default=3000, ge=10, description="most collision parts about the bodies that are thrown")
    robot_contacts: int = Field(
        default=1000, ge=0, description="contacts of thrown robots with rock; 0: none are thrown"
    )
    ball_contacts: int = Field(default=2000, ge=0, description="contacts of the balls that are pushed; 0: none are")
    seed: int = Field(default=9, ge=0, description="seed of the sampled parts and of what is thrown")
    limits: dict[str, Limit] = Field(
        default_factory=dict, description="limit of each figure, by the figure's name; null: no limit"
    )

    @field_validator("limits", mode="before")
    @classmethod
    def _join_groups(cls, value: Any) -> Any:
        return _flatten(value) if isinstance(value, dict) else value

    def applying(self, measured: Iterable[str]) -> dict[str, Limit]:
        """Return the limits on figures of groups that are measured, given figures or groups by name.

        Not all are: bodies may not be thrown, and a survey of stations is no solid.
        """
        groups = {name.partition(".")[0] for name in measured}
        return {name: limit for name, limit in self.limits.items() if name.partition(".")[0] in groups}


class ValidationParams(MadeBy):
    """What a world is made by, limits by metric, and how surfaces are sampled.

    In `conf/` the limits are nested like the metrics, and null means no limit. Here, dots join the nested names.
    """

    overlay: Literal["rough", "none"] = Field("rough", description="whether the world must have visible rock")
    extent: Literal["full", "certificate"] = Field(
        "full", description="certificate: the certificate alone, for large families of worlds that were just built"
    )
    robot_height_m: float = Field(gt=0, description="height at which LiDAR and walls are compared")
    texture: TextureReportParams = Field(description="how points of the rock are sampled for its texture's figures")
    replay: ReplayParams = Field(description="the real sweeps that are replayed")
    certificate: CertificateParams = Field(description="the proof of containment")
    limits: dict[str, Limit] = Field(description="limit of each metric, by the metric's name; null: no limit")
    volume: VolumeProofParams = Field(
        default_factory=VolumeProofParams, description="the certificate of a world that is one volume"
    )

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
