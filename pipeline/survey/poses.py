"""The plan's scale from surveyed scanner poses: their sweeps are laid onto the plan's walls."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import map_coordinates
from scipy.optimize import least_squares

from pipeline.errors import InputError
from pipeline.types import Image

_ROBUST_M = 0.3
_CAPTURE_M = 4.0  # a return farther than this from any wall says nothing more
_MAX_ERROR_M = 0.6
_POSE_SIGMA = np.array([0.7, 0.7, 0.02])  # m, m, rad: how far off a surveyed pose may be
_PRIOR_WEIGHT = 5.0
_SWEEP_WEIGHT = 200.0
_ALONG_PX = (-60, -30, 0, 30, 60)  # starts along the drift, whose straight walls leave that direction loose
_SCALE_STEP = 0.0065
_MAX_POINTS = 400
_INK_CHROMA = 40


def read_poses(path: Path) -> dict[str, tuple[float, float, float]]:
    """Read surveyed poses: pose number -> x, y (m) and heading (rad) in the survey's own frame."""
    rows = _read_columns(path, ("pose_num", "x_truth", "y_truth", "theta_truth"))
    return {row[0]: (_finite(path, row[1]), _finite(path, row[2]), _finite(path, row[3])) for row in rows}


def read_sweep(path: Path, max_range_m: float, max_range_var_m2: float) -> np.ndarray:
    """Read a planar sweep as (n, 2) m in the scanner's frame; far returns and bins that straddle an edge are dropped.

    A bin with a large range variance averages over a near and a far surface and lies on neither.
    """
    rows = _read_columns(path, ("theta_mu", "range_mu", "range_var"))
    polar = np.array([[_finite(path, value) for value in row] for row in rows]).reshape(-1, 3)
    kept = polar[(polar[:, 1] > 0) & (polar[:, 1] <= max_range_m) & (polar[:, 2] <= max_range_var_m2)]
    if len(kept) < 30:
        raise InputError(
            f"{path}: {len(kept)} usable returns of {len(polar)} (range <= {max_range_m:g} m, "
            f"variance <= {max_range_var_m2:g} m2); at least 30 are needed"
        )
    return np.column_stack([kept[:, 1] * np.cos(kept[:, 0]), kept[:, 1] * np.sin(kept[:, 0])])


@dataclass(frozen=True)
class PoseScale:
    """A scale fitted to sweeps, px/m, the interval that explains them nearly as well, and the fit's error, m."""

    px_per_m: float
    low_px_per_m: float
    high_px_per_m: float
    error_m: float


def scale_from_poses(
    plan: Image,
    poses: dict[str, tuple[float, float, float]],
    sweeps: dict[str, np.ndarray],
    origin_px: tuple[float, float],
    scale_range_px_per_m: tuple[float, float],
) -> PoseScale:
    """Fit one similarity from the survey's frame to the plan so that the sweeps' returns lie on its walls.

    Each sweep may shift and turn a little by itself, as surveyed poses are off by decimetres and a degree or two; a
    prior holds these corrections small. A long straight drift holds a scan loosely along its axis, so neighbouring
    scales fit nearly as well: the interval of scales whose cost is within a tenth of the best is part of the answer.

    Parameters
    ----------
    plan : (rows, cols, 3) uint8
    poses : dict
        x, y (m), heading (rad) of each sweep's scanner.
    sweeps : dict of (n, 2) m
        Returns in the scanner's frame.
    origin_px : (col, row)
        Roughly where the survey's origin lies in the plan; the fit starts within `_ALONG_PX` of it.
    scale_range_px_per_m : (low, high)
        The scales searched.

    Raises
    ------
    InputError
        If a sweep has no pose, or no scale in the range lays the returns onto walls.
    """
    missing = sorted(set(sweeps) - set(poses))
    if missing:
        raise InputError(f"poses: sweep {missing[0]} has no pose (poses: {', '.join(sorted(poses))})")
    scans = [(np.array(poses[name]), _thinned(sweep)) for name, sweep in sorted(sweeps.items())]
    to_wall = _distance_to_walls(plan)
    low, high = scale_range_px_per_m
    scales = np.linspace(low, high, max(5, round((high - low) / (_SCALE_STEP * low)) + 1))
    fits = [_fit_at(scale, scans, to_wall, origin_px) for scale in scales]
    costs = np.array([cost for cost, _ in fits])
    best = int(costs.argmin())
    if best in (0, len(scales) - 1) or fits[best][1] > _MAX_ERROR_M:
        raise InputError(
            f"poses: no scale inside {low:g}-{high:g} px/m lays the sweeps onto the plan's walls "
            f"(best {scales[best]:.2f} px/m, error {fits[best][1]:.2f} m, at most {_MAX_ERROR_M} m)"
        )
    near = scales[costs <= 1.1 * costs[best]]
    return PoseScale(float(scales[best]), float(near[0]), float(near[-1]), fits[best][1])


def _fit_at(scale: float, scans: list, to_wall: np.ndarray, origin_px: tuple[float, float]) -> tuple[float, float]:
    """Return the least cost at one scale, and the mean over the sweeps of their median distance to a wall, m."""

    def reached_m(q: np.ndarray) -> list[np.ndarray]:
        turn, col, row = q[:3]
        c, s = math.cos(turn) * scale, math.sin(turn) * scale
        reached = []
        for ((x, y, heading), scan), (dx, dy, dturn) in zip(scans, q[3:].reshape(-1, 3), strict=True):
            ch, sh = math.cos(heading + dturn), math.sin(heading + dturn)
            px, py = (scan @ np.array([[ch, sh], [-sh, ch]]) + [x + dx, y + dy]).T
            at = [row - px * s - py * c - 0.5, col + px * c - py * s - 0.5]
            reached.append(np.minimum(map_coordinates(to_wall, at, order=1, mode="nearest") / scale, _CAPTURE_M))
        return reached

    def residuals(q: np.ndarray) -> np.ndarray:
        # Cauchy's loss: plan and scan differ where the drift was cluttered. Every sweep weighs the same.
        walls = [np.sqrt(np.log1p((r / _ROBUST_M) ** 2) * (_SWEEP_WEIGHT / len(r))) for r in reached_m(q)]
        return np.concatenate([*walls, _PRIOR_WEIGHT * (q[3:].reshape(-1, 3) / _POSE_SIGMA).ravel()])

    size = np.concatenate([[0.005, 5.0, 5.0], np.tile([0.5, 0.5, 0.01], len(scans))])
    starts = [np.concatenate([[0.0, origin_px[0] + d, origin_px[1]], np.zeros(3 * len(scans))]) for d in _ALONG_PX]
    best = min((least_squares(residuals, q, x_scale=size, max_nfev=60) for q in starts), key=lambda fit: fit.cost)
    return float(best.cost), float(np.mean([np.median(r) for r in reached_m(best.x)]))


def _thinned(sweep: np.ndarray) -> np.ndarray:
    return sweep[:: max(1, len(sweep) // _MAX_POINTS)]


def _distance_to_walls(plan: Image) -> np.ndarray:
    """Return each pixel's distance, px, to the outline of the plan's largest dark region."""
    _, dark = cv2.threshold(cv2.cvtColor(plan, cv2.COLOR_BGR2GRAY), 0, 1, cv2.THRESH_BINARY_INV | cv2.THRESH_OTSU)
    dark[plan.max(axis=2) - plan.min(axis=2) > _INK_CHROMA] = 0
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (9, 9))
    dark = cv2.morphologyEx(cv2.morphologyEx(dark, cv2.MORPH_CLOSE, disc), cv2.MORPH_OPEN, disc)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(dark)
    if count < 2:
        raise InputError("poses: the plan shows no dark region to lay the sweeps onto")
    light = (labels != 1 + stats[1:, cv2.CC_STAT_AREA].argmax()).astype(np.uint8)
    return cv2.distanceTransform(light, cv2.DIST_L2, 5) + cv2.distanceTransform(1 - light, cv2.DIST_L2, 5) - 0.5


def _read_columns(path: Path, columns: tuple[str, ...]) -> list[list[str]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.DictReader(stream)
            missing = [c for c in columns if c not in (reader.fieldnames or [])]
            if missing:
                raise InputError(f"{path}: no column {', '.join(missing)}")
            return [[row[c] or "" for c in columns] for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as CSV ({error})") from error


def _finite(path: Path, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{path}: {text!r} is not a number") from None
    if not math.isfinite(value):
        raise InputError(f"{path}: {text} is not finite")
    return value
