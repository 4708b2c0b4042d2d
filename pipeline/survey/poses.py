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

_ROBUST_M = 0.3  # wall distances beyond this count less: plan and scan differ where the drift was cluttered
_CAPTURE_M = 8.0  # a return farther than this from any wall says nothing more
_CAP_M = 1.0  # in the error that scales are compared by; what lies beyond is no wall of the plan
_MAX_ERROR_M = 0.6  # surveyed headings are good to about 2 deg: 0.5 m at 15 m
_ALONG_PX = (-60, -30, 0, 30, 60)  # starts along the drift, whose straight walls leave that direction loose
_SCALE_STEP = 0.005
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

    A scale's error is the returns' mean distance to the walls, capped at `_CAP_M`, with equal weight to each sweep. A
    long straight drift holds a scan loosely along its axis, so other scales fit nearly as well: the interval of scales
    whose error is within a tenth of the best is part of the answer.

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
    each = [_in_survey_frame(poses, name, sweep) for name, sweep in sorted(sweeps.items())]
    points, ends = np.vstack(each), np.cumsum([len(sweep) for sweep in each])[:-1]
    to_wall = _distance_to_walls(plan)

    def reach_m(place: np.ndarray, scale: float) -> np.ndarray:
        turn, col, row = place
        x, y = points.T * scale
        u, v = col + x * math.cos(turn) - y * math.sin(turn), row - x * math.sin(turn) - y * math.cos(turn)
        return np.minimum(map_coordinates(to_wall, [v - 0.5, u - 0.5], order=1, mode="nearest") / scale, _CAPTURE_M)

    def error_m(scale: float) -> float:
        fits = [
            least_squares(
                reach_m, [0.0, origin_px[0] + along, origin_px[1]], args=(scale,),
                loss="soft_l1", f_scale=_ROBUST_M, x_scale=[0.005, 5, 5], max_nfev=40,
            )
            for along in _ALONG_PX
        ]  # fmt: skip
        reached = [np.split(reach_m(fit.x, scale), ends) for fit in fits]
        return min(float(np.mean([np.minimum(sweep, _CAP_M).mean() for sweep in sweeps_m])) for sweeps_m in reached)

    low, high = scale_range_px_per_m
    scales = np.linspace(low, high, max(5, round((high - low) / (_SCALE_STEP * low))))
    errors = np.array([error_m(scale) for scale in scales])
    best = int(errors.argmin())
    if best in (0, len(scales) - 1) or errors[best] > _MAX_ERROR_M:
        raise InputError(
            f"poses: no scale inside {low:g}-{high:g} px/m lays the sweeps onto the plan's walls "
            f"(best {scales[best]:.2f} px/m, error {errors[best]:.2f} m, at most {_MAX_ERROR_M} m)"
        )
    near = scales[errors <= 1.1 * errors[best]]
    return PoseScale(float(scales[best]), float(near[0]), float(near[-1]), float(errors[best]))


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


def _in_survey_frame(poses: dict, name: str, sweep: np.ndarray) -> np.ndarray:
    if name not in poses:
        raise InputError(f"poses: sweep {name} has no pose (poses: {', '.join(sorted(poses))})")
    x, y, heading = poses[name]
    thinned = sweep[:: max(1, len(sweep) // _MAX_POINTS)]
    c, s = math.cos(heading), math.sin(heading)
    return thinned @ np.array([[c, s], [-s, c]]) + [x, y]


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
