"""Fit the plan's scale to surveyed scanner poses and their sweeps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import shapely

from minesurveys.errors import GeometryError, InputError
from pipeline.geometry.outline.binarize import dark_pixels
from pipeline.geometry.outline.trace import trace_outline
from pipeline.geometry.raycast import RayCaster, upright_walls
from pipeline.scans.registration import Search, register_scans
from pipeline.scans.sweeps import Returns, SurveyedPose, require_poses
from pipeline.types import Frame, Image

_MAX_ERROR_M = 1.0  # the published plan draws drifts 1 to 2 m too wide; a wrong scale has a larger error
_TURN_RAD, _SHIFT_M = math.radians(2.0), 10.0
CORRECTION_M, CORRECTION_RAD = 1.5, math.radians(3.0)  # largest error of a surveyed pose
_WORKINGS_CHROMA = 40


@dataclass(frozen=True)
class PoseScale:
    """A scale fitted to sweeps, px/m, the interval of scales that fit nearly as well, and the fit's error, m."""

    px_per_m: float
    low_px_per_m: float
    high_px_per_m: float
    error_m: float


def scale_from_poses(
    plan: Image,
    poses: dict[str, SurveyedPose],
    sweeps: dict[str, Returns],
    origin_px: tuple[float, float],
    scale_range_px_per_m: tuple[float, float],
) -> PoseScale:
    """Fit one similarity from the survey's frame to the plan, so that the sweeps agree with the plan's walls.

    Parameters
    ----------
    plan : (rows, cols, 3) uint8
    poses : dict of SurveyedPose
    sweeps : dict of Returns
    origin_px : (col, row)
        Approximate position of the survey's origin in the plan. The search extends 10 m around it.
    scale_range_px_per_m : (low, high)
        The range of scales to search.

    Returns
    -------
    PoseScale
        The error is the mean over the sweeps of the median range error.

    Raises
    ------
    InputError
        If a sweep has no pose, or no scale in the range fits the returns to the walls.
    """
    require_poses(poses, sweeps)
    low, high = scale_range_px_per_m
    middle = (low + high) / 2
    frame = Frame(middle, *origin_px, plan.shape[1], plan.shape[0])
    free = _dark_region(plan, frame)
    caster = RayCaster(upright_walls(free, 1.0))

    def cast(places: np.ndarray, bearings: np.ndarray) -> np.ndarray:
        return caster.fan(places, bearings, 0.5)

    search = Search((low / middle, high / middle), _TURN_RAD, _SHIFT_M, CORRECTION_M, CORRECTION_RAD)
    try:
        registration = register_scans(
            {name: poses[name].planar for name in sweeps},
            {name: s.fan for name, s in sweeps.items()},
            cast,
            lambda places: shapely.contains_xy(free, places[:, 0], places[:, 1]),
            search,
        )
    except GeometryError as error:
        raise InputError(f"poses: no scale inside {low:g}-{high:g} px/m places them in the plan's drifts") from error
    errors = [
        np.median(np.abs(cast(np.array([pose[:2]]), (pose[2] + sweeps[name].bearing)[None])[0] - sweeps[name].range_m))
        for name, pose in registration.poses.items()
    ]
    error_m, scale = float(np.mean(errors)), registration.similarity.scale
    if not search.scale[0] < scale < search.scale[1] or error_m > _MAX_ERROR_M:
        raise InputError(
            f"poses: no scale inside {low:g}-{high:g} px/m fits the sweeps to the plan's walls "
            f"(best {scale * middle:.2f} px/m, error {error_m:.2f} m, limit {_MAX_ERROR_M} m)"
        )
    interval = [s * middle for s in (*registration.scale_interval, scale)]
    return PoseScale(scale * middle, min(interval), max(interval), error_m)


def _dark_region(plan: Image, frame: Frame) -> shapely.Polygon:
    """Return the plan's largest dark region, m."""
    dark = dark_pixels(cv2.cvtColor(plan, cv2.COLOR_BGR2GRAY)).astype(np.uint8)
    dark[plan.max(axis=2) - plan.min(axis=2) > _WORKINGS_CHROMA] = 0
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (9, 9))
    dark = cv2.morphologyEx(cv2.morphologyEx(dark, cv2.MORPH_CLOSE, disc), cv2.MORPH_OPEN, disc)
    if not dark.any():
        raise InputError("poses: the plan has no dark region to fit the sweeps to")
    return trace_outline(dark > 0, frame)
