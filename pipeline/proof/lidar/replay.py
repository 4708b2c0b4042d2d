"""LiDAR replay: place real sweeps in a world, cast their bearings in its model, and compare the ranges."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.errors import GeometryError, InputError
from pipeline.geometry.raycast import RayCaster
from pipeline.params.validation import ReplayParams
from pipeline.proof.lidar.replay_report import Replay, SweepReplay, range_errors, report_replay
from pipeline.proof.lidar.swept import SweptWorld
from pipeline.scans.registration import Pose, Registration, Search, register_scans
from pipeline.scans.sweeps import (
    Returns,
    SurveyedPose,
    gate_returns,
    read_poses,
    read_returns,
    require_poses,
    static_returns,
)


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


def replay_sweeps(world: SweptWorld, poses: Path, sweeps: dict[str, Path], params: ReplayParams) -> Replay:
    """Register surveyed poses to a world by their sweeps and compare every return's range with the world's.

    Parameters
    ----------
    world : SweptWorld
        Of either model.
    poses : Path
    sweeps : dict of Path
        By pose number.
    params : ReplayParams
        Gates, search and bounds.

    Raises
    ------
    InputError
        If the world has no visible rock, a file cannot be read, a sweep has no pose, or no placement puts the poses
        into the workings.
    """
    if world.visible is None:
        raise InputError(
            "the world has no visible rock to compare sweeps with: it was made with preset=light; make it without"
        )
    surveyed = read_poses(poses)
    returns = {name: read_returns(path) for name, path in sweeps.items()}
    require_poses(surveyed, returns)
    gated = {name: _gate(sweeps[name], each, params) for name, each in returns.items()}
    registration = _register(poses, surveyed, gated, world, params)
    reports, points, errors = {}, {}, {}
    for name, pose in registration.poses.items():
        reports[name], errors[name] = _compare(
            sweeps[name],
            len(returns[name].range_m),
            gated[name],
            pose,
            registration.corrections[name],
            world,
            world.visible,
            params.sensor_height_m,
        )
        points[name] = _points(gated[name].registered, pose)
    return Replay(report_replay(registration, reports, surveyed, world, params), points, errors)


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
    gates = params.max_range_m, params.max_range_var_m2, math.radians(params.min_incidence_deg)
    counted, removed = static_returns(returns, *gates)
    if not len(counted.range_m):
        raise InputError(f"{sweep}: no return passes the gates ({removed})")
    return _GatedReturns(registered, counted, removed)


def _register(
    poses: Path,
    surveyed: dict[str, SurveyedPose],
    gated: dict[str, _GatedReturns],
    world: SweptWorld,
    params: ReplayParams,
) -> Registration:
    """Place the surveyed poses in the mine by their returns and the collision walls."""

    def cast(places: np.ndarray, bearings: np.ndarray) -> np.ndarray:
        return world.ranges(world.collision, places, bearings, params.sensor_height_m)

    def inside(places: np.ndarray) -> np.ndarray:
        return np.isfinite(world.floor_m(places))

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
    world: SweptWorld,
    visible: RayCaster,
    sensor_height_m: float,
) -> tuple[SweepReplay, np.ndarray]:
    """Compare one placed sweep with the collision and the visible walls; return its report and collision errors, m.

    Raises
    ------
    InputError
        If no counted return lies within the plan's frame.
    """

    def errors_against(caster: RayCaster, some: Returns) -> np.ndarray:
        place, bearings = np.array([pose[:2]]), (pose[2] + some.bearing)[None]
        return world.ranges(caster, place, bearings, sensor_height_m)[0] - some.range_m

    within = _inside_frame(gated.counted, pose, world)
    counted = gated.counted.kept(within)
    removed = {**gated.removed, "beyond_the_frame": int((~within).sum())}
    if not len(counted.range_m):
        raise InputError(f"{sweep}: no return passes the gates ({removed})")
    errors = errors_against(world.collision, counted)
    dx, dy, dturn = correction
    report = SweepReplay(
        returns=returns,
        used=len(counted.range_m),
        gated=removed,
        pose_m=(round(pose[0], 3), round(pose[1], 3), round(pose[2], 5)),
        correction_m=(round(dx, 3), round(dy, 3)),
        correction_deg=round(math.degrees(dturn), 3),
        collision=range_errors(errors),
        visible=range_errors(errors_against(visible, counted)),
        every_return_median_m=round(float(np.median(np.abs(errors_against(world.collision, gated.registered)))), 4),
    )
    return report, errors


def _inside_frame(returns: Returns, pose: Pose, world: SweptWorld) -> np.ndarray:
    """Return which returns (n,) lie within the plan's frame."""
    west, south, east, north = world.frame.extent_m
    x, y = _points(returns, pose).T
    return (x >= west) & (x <= east) & (y >= south) & (y <= north)


def _points(returns: Returns, pose: Pose) -> np.ndarray:
    bearing = pose[2] + returns.bearing
    return np.array(pose[:2]) + returns.range_m[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])
