"""LiDAR replay: place real sweeps in a world, cast their bearings in its model, and compare the ranges."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import shapely
from scipy.stats import theilslopes
from shapely import Polygon

from minexplore.bundle import WALLS, GeomGroup
from pipeline.errors import GeometryError, InputError
from pipeline.geometry.raycast import RayCaster
from pipeline.geometry.registration import Pose, Registration, Search, register_scans
from pipeline.mjcf.bundle import World, geom_triangles, visible_triangles
from pipeline.params.validation import ReplayParams
from pipeline.survey.poses import Returns, SurveyedPose, gate_returns, read_poses, read_returns, require_poses

_NEAR_M, _FAR_M = 0.25, 0.5
_NEIGHBOUR_RAD = math.radians(1.0)
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


def find_sweeps(folder: Path) -> dict[str, Path]:
    """Return the files `sweep_NAME.csv` of a folder by name.

    Raises
    ------
    InputError
        If there is none.
    """
    found = {p.stem.removeprefix("sweep_"): p for p in sorted(folder.glob("sweep_*.csv"))}
    if not found:
        raise InputError(f"{folder}: no file is named sweep_NAME.csv")
    return found


def replay_sweeps(world: World, free: Polygon, poses: Path, sweeps: dict[str, Path], params: ReplayParams) -> Replay:
    """Register surveyed poses to a world by their sweeps and compare every return's range with the world's.

    Parameters
    ----------
    world : World
    free : shapely.Polygon, m, mine frame
        Where a scanner can stand.
    poses : Path
    sweeps : dict of Path
        By pose number.
    params : ReplayParams
        Gates, search and bounds.

    Raises
    ------
    InputError
        If a file cannot be read, a sweep has no pose, or no placement puts the poses into the workings.
    """
    surveyed = read_poses(poses)
    returns = {name: read_returns(path) for name, path in sweeps.items()}
    require_poses(surveyed, returns)
    gated = {name: _gate(sweeps[name], each, params) for name, each in returns.items()}
    collision = RayCaster(geom_triangles(world.model, GeomGroup.COLLISION))
    visible = RayCaster(visible_triangles(world.model, WALLS))
    registration = _register(poses, surveyed, gated, collision, free, params)
    reports, points, errors = {}, {}, {}
    for name, pose in registration.poses.items():
        reports[name], errors[name] = _compare(
            sweeps[name],
            len(returns[name].range_m),
            gated[name],
            pose,
            registration.corrections[name],
            (collision, visible),
            world,
            params.sensor_height_m,
        )
        points[name] = _points(gated[name].registered, pose)
    return Replay(_report(registration, reports, surveyed, world, params), points, errors)


@dataclass(frozen=True)
class _GatedReturns:
    """The returns that place a scan, those that count for the errors, and how many each rule removed from these."""

    registered: Returns
    counted: Returns
    removed: dict[str, int]


def _gate(sweep: Path, returns: Returns, params: ReplayParams) -> _GatedReturns:
    """Gate the returns of one sweep.

    Raises
    ------
    InputError
        If no return is left.
    """
    registered = gate_returns(sweep, returns, params.register_range_m, params.max_range_var_m2)
    counted, removed = _static(returns, params)
    if not len(counted.range_m):
        raise InputError(f"{sweep}: no return passes the gates ({removed})")
    return _GatedReturns(registered, counted, removed)


def _register(
    poses: Path,
    surveyed: dict[str, SurveyedPose],
    gated: dict[str, _GatedReturns],
    collision: RayCaster,
    free: Polygon,
    params: ReplayParams,
) -> Registration:
    """Place the surveyed poses in the mine by their returns and the collision walls."""

    def cast(places: np.ndarray, bearings: np.ndarray) -> np.ndarray:
        return collision.fan(places, bearings, params.sensor_height_m)

    def inside(places: np.ndarray) -> np.ndarray:
        return shapely.contains_xy(free, places[:, 0], places[:, 1])

    search = Search(
        params.scale,
        math.radians(params.turn_deg),
        params.shift_m,
        params.correction_m,
        math.radians(params.correction_deg),
    )
    coarse = {name: each.registered.fan for name, each in gated.items()}
    fine = {name: each.counted.fan for name, each in gated.items()}
    try:
        return register_scans({name: surveyed[name].planar for name in gated}, coarse, cast, inside, search, fine)
    except GeometryError as error:
        raise InputError(f"{poses}: {error}") from error


def _compare(
    sweep: Path,
    returns: int,
    gated: _GatedReturns,
    pose: Pose,
    correction: Pose,
    walls: tuple[RayCaster, RayCaster],
    world: World,
    sensor_height_m: float,
) -> tuple[SweepReplay, np.ndarray]:
    """Compare one placed sweep with the collision and the visible walls; return its report and collision errors, m.

    Raises
    ------
    InputError
        If no counted return lies within the plan's frame.
    """

    def errors_against(caster: RayCaster, some: Returns) -> np.ndarray:
        return caster.fan(np.array([pose[:2]]), (pose[2] + some.bearing)[None], sensor_height_m)[0] - some.range_m

    within = _inside_frame(gated.counted, pose, world)
    counted = gated.counted.kept(within)
    removed = {**gated.removed, "beyond_the_frame": int((~within).sum())}
    if not len(counted.range_m):
        raise InputError(f"{sweep}: no return passes the gates ({removed})")
    collision, visible = walls
    errors = errors_against(collision, counted)
    dx, dy, dturn = correction
    report = SweepReplay(
        returns=returns,
        used=len(counted.range_m),
        gated=removed,
        pose_m=(round(pose[0], 3), round(pose[1], 3), round(pose[2], 5)),
        correction_m=(round(dx, 3), round(dy, 3)),
        correction_deg=round(math.degrees(dturn), 3),
        collision=_errors(errors),
        visible=_errors(errors_against(visible, counted)),
        every_return_median_m=round(float(np.median(np.abs(errors_against(collision, gated.registered)))), 4),
    )
    return report, errors


def _static(returns: Returns, params: ReplayParams) -> tuple[Returns, dict[str, int]]:
    """Drop, in this order: bins on an edge, far returns, and grazing ones; returns how many each rule took."""
    rules = {
        "edge": returns.variance_m2 > params.max_range_var_m2,
        "far": returns.range_m > params.max_range_m,
        "grazing": _incidence_rad(returns) < math.radians(params.min_incidence_deg),
    }
    kept, gated = np.ones(len(returns.range_m), bool), {}
    for name, rule in rules.items():
        gated[name] = int((kept & rule).sum())
        kept &= ~rule
    return returns.kept(kept), gated


def _inside_frame(returns: Returns, pose: Pose, world: World) -> np.ndarray:
    """Return which returns (n,) lie within the plan's frame."""
    west, south, east, north = world.record.plan_frame.extent_m
    x, y = _points(returns, pose).T
    return (x >= west) & (x <= east) & (y >= south) & (y <= north)


def _incidence_rad(returns: Returns) -> np.ndarray:
    """Return the angle between beam and wall as the neighbouring returns show it; pi / 2 where there are none."""
    order = np.argsort(returns.bearing)
    bearing, ranges = returns.bearing[order], returns.range_m[order]
    step, rise = bearing[2:] - bearing[:-2], ranges[2:] - ranges[:-2]
    angle = np.full(len(order), math.pi / 2)
    near = step < 2 * _NEIGHBOUR_RAD
    angle[1:-1] = np.where(near, np.arctan2(ranges[1:-1] * step, np.abs(rise)), math.pi / 2)
    found = np.empty_like(angle)
    found[order] = angle
    return found


def _points(returns: Returns, pose: Pose) -> np.ndarray:
    bearing = pose[2] + returns.bearing
    return np.array(pose[:2]) + returns.range_m[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])


def _errors(error: np.ndarray) -> RangeErrors:
    size = np.minimum(np.abs(error), _MISS_M)
    error = np.clip(error, -_MISS_M, _MISS_M)
    return RangeErrors(
        median_m=round(float(np.median(size)), 4),
        p90_m=round(float(np.percentile(size, 90)), 4),
        within_0_25_m=round(float((size <= _NEAR_M).mean()), 4),
        within_0_5_m=round(float((size <= _FAR_M).mean()), 4),
        bias_m=round(float(np.median(error)), 4),
    )


def _report(
    found: Registration,
    sweeps: dict[str, SweepReplay],
    surveyed: dict[str, SurveyedPose],
    world: World,
    params: ReplayParams,
) -> ReplayReport:
    similarity, px_per_m = found.similarity, world.record.plan_frame.px_per_m
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
        world_grade_deg=-world.record.tilt_deg,  # a positive tilt lowers the east
    )


def grade_of_poses(poses: dict[str, SurveyedPose]) -> float | None:
    """Return the grade, deg, along the poses' own main direction; None where fewer than three have a height."""
    known = np.array([[p.x, p.y, p.z] for p in poses.values() if p.z is not None])
    return grade_along(known) if len(known) >= _LEAST_HEIGHTS and np.ptp(known[:, :2], axis=0).max() > 1 else None


def grade_along(points: np.ndarray) -> float:
    """Return the grade, deg, of points (n, 3) m along their main direction in plan, turned to rise with x.

    References
    ----------
    Theil 1950 and Sen 1968, doi:10.1080/01621459.1968.10480934 (median of slopes, by scipy)
    """
    xy = points[:, :2] - points[:, :2].mean(axis=0)
    along = np.linalg.svd(xy, full_matrices=False)[2][0]
    slope = theilslopes(points[:, 2], xy @ (along if along[0] >= 0 else -along))[0]
    return round(math.degrees(math.atan(float(slope))), 3)
