"""The report of a LiDAR replay: range errors of each sweep, the scale that the poses imply, and the grade."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from pipeline.params.validation import ReplayParams
from pipeline.proof.lidar.swept import SweptWorld
from pipeline.scans.registration import Pose, Registration
from pipeline.scans.sweeps import SurveyedPose

_NEAR_M, _FAR_M = 0.25, 0.5
_LEAST_HEIGHTS = 3
_MISS_M = 100.0  # error of a ray that hits nothing


@dataclass(frozen=True)
class RangeErrors:
    """Cast less measured range over the returns that count, m; absolute but for `bias_m`, the median with its sign."""

    median_m: float
    p90_m: float
    within_0_25_m: float
    within_0_5_m: float
    bias_m: float


@dataclass(frozen=True)
class SweepReplay:
    """One sweep: the returns that each gate removed, its pose and correction, and its errors against both walls.

    `collision` are errors against the collision walls, `visible` against the rough surface. `every_return_median_m` is
    against the collision walls, with the gates of the registration only.
    """

    returns: int
    used: int
    gated: dict[str, int]
    pose_m: Pose
    correction_m: tuple[float, float]
    correction_deg: float
    collision: RangeErrors
    visible: RangeErrors
    every_return_median_m: float


@dataclass(frozen=True)
class ReplayReport:
    """The registration of all poses, the scale it implies, the errors, and the grade where heights are known."""

    sweeps: dict[str, SweepReplay]
    scale: float | None = None
    scale_interval: tuple[float, float] | None = None
    implied_px_per_m: float | None = None
    plan_px_per_m: float | None = None
    turn_deg: float | None = None
    shift_m: tuple[float, float] | None = None
    largest_correction_m: float | None = None
    correction_bound_m: float | None = None
    grade_deg: float | None = None
    world_grade_deg: float | None = None


@dataclass(frozen=True)
class Replay:
    """The report, and for its picture each sweep's returns (n, 2) m in the mine frame and range errors (n,) m."""

    report: ReplayReport
    points: dict[str, np.ndarray] = field(default_factory=dict)
    errors: dict[str, np.ndarray] = field(default_factory=dict)


def range_errors(error: np.ndarray) -> RangeErrors:
    """Return the figures of cast less measured ranges (n,), m."""
    size = np.minimum(np.abs(error), _MISS_M)
    error = np.clip(error, -_MISS_M, _MISS_M)
    return RangeErrors(
        median_m=round(float(np.median(size)), 4),
        p90_m=round(float(np.percentile(size, 90)), 4),
        within_0_25_m=round(float((size <= _NEAR_M).mean()), 4),
        within_0_5_m=round(float((size <= _FAR_M).mean()), 4),
        bias_m=round(float(np.median(error)), 4),
    )


def report_replay(
    found: Registration,
    sweeps: dict[str, SweepReplay],
    surveyed: dict[str, SurveyedPose],
    world: SweptWorld,
    params: ReplayParams,
) -> ReplayReport:
    """Return the report of a registration, the errors of its sweeps, and the poses' heights."""
    similarity, px_per_m = found.similarity, world.frame.px_per_m
    return ReplayReport(
        sweeps=sweeps,
        scale=round(similarity.scale, 5),
        scale_interval=(round(found.scale_interval[0], 4), round(found.scale_interval[1], 4)),
        implied_px_per_m=round(similarity.scale * px_per_m, 3),
        plan_px_per_m=px_per_m,
        turn_deg=round(math.degrees(similarity.turn_rad), 3),
        shift_m=(round(similarity.east_m, 2), round(similarity.north_m, 2)),
        largest_correction_m=max(round(math.hypot(*s.correction_m), 3) for s in sweeps.values()),
        correction_bound_m=params.correction_m,
        grade_deg=grade_of_poses(surveyed),
        world_grade_deg=_grade_of_world(found, surveyed, world),
    )


def _grade_of_world(found: Registration, surveyed: dict[str, SurveyedPose], world: SweptWorld) -> float | None:
    """Return the grade, deg, of the world's floors where the surveyed poses are placed; None where they state none.

    The poses' own is of the same places, so the two compare.
    """
    places = np.array([found.similarity.place(p.planar)[:2] for p in surveyed.values()])
    heights = world.floor_m(places)
    known = np.column_stack([places, heights])[np.isfinite(heights)]
    grade = _grade_of(known)
    return None if grade is None else round(grade - world.tilt_deg, 3)  # a positive tilt lowers the east


def grade_of_poses(poses: dict[str, SurveyedPose]) -> float | None:
    """Return the grade, deg, along the poses' own main direction; None where fewer than three have a height."""
    known = np.array([[p.x, p.y, p.z] for p in poses.values() if p.z is not None])
    return _grade_of(known)


def _grade_of(known: np.ndarray) -> float | None:
    """Return the grade, deg, along points (n, 3) m; None where they are too few, or at one place."""
    return grade_along(known) if len(known) >= _LEAST_HEIGHTS and np.ptp(known[:, :2], axis=0).max() > 1 else None


def grade_along(points: np.ndarray) -> float:
    """Return the grade, deg, of points (n, 3) m along their main direction in plan, turned to rise with x.

    References
    ----------
    Theil 1950 and Sen 1968, doi:10.1080/01621459.1968.10480934 (median of slopes, by scipy)
    """
    xy = points[:, :2] - points[:, :2].mean(axis=0)
    along = np.linalg.svd(xy, full_matrices=False)[2][0]
    from scipy.stats import theilslopes  # takes half a second to load, and most worlds have no sweeps

    slope = theilslopes(points[:, 2], xy @ (along if along[0] >= 0 else -along))[0]
    return round(math.degrees(math.atan(float(slope))), 3)
