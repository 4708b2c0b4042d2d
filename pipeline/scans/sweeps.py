"""Read surveyed scanner poses and planar sweeps."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from minesurveys.errors import InputError
from minesurveys.guard.csv_text import read_csv_text
from minesurveys.guard.plain_file import read_text_bytes, require_at_most
from minesurveys.guard.plain_number import plain_number
from minesurveys.limits import reader_limits
from pipeline.scans.registration import Pose

_LEAST_RETURNS = 30
_NEIGHBOUR_RAD = math.radians(1.0)
_QUATERNION_COLUMNS = 8


class SurveyedPose(NamedTuple):
    """A scanner's pose in the survey's own frame: x, y in m, heading in rad, elevation z in m if it was measured."""

    x: float
    y: float
    heading: float
    z: float | None = None

    @property
    def planar(self) -> Pose:
        """Return x, y, heading."""
        return self.x, self.y, self.heading


@dataclass(frozen=True)
class Returns:
    """A planar sweep: bearing (n,) rad in the scanner's frame, range (n,) m and its variance (n,) m2 within the bin."""

    bearing: np.ndarray
    range_m: np.ndarray
    variance_m2: np.ndarray

    def kept(self, mask: np.ndarray) -> Returns:
        """Return the returns where a mask (n,) is true."""
        return Returns(self.bearing[mask], self.range_m[mask], self.variance_m2[mask])

    @property
    def fan(self) -> tuple[np.ndarray, np.ndarray]:
        """Return bearings and ranges."""
        return self.bearing, self.range_m


def read_poses(path: Path) -> dict[str, SurveyedPose]:
    """Read surveyed poses by number.

    The file is a CSV table with the columns pose_num, x_truth, y_truth, theta_truth and optionally z_truth (m, rad), or
    the dataset's `scanPoseEstimates.dat` with rows `id qx qy qz qw x y z` and no header.
    """
    if path.suffix == ".dat":
        return _read_pose_estimates(path)
    rows = _read_columns(path, ("pose_num", "x_truth", "y_truth", "theta_truth"), ("z_truth",))
    poses = {}
    for number, *values, height in rows:
        x, y, heading = (_finite(path, v) for v in values)
        poses[number] = SurveyedPose(x, y, heading, _finite(path, height) if height else None)
    return poses


def _read_pose_estimates(path: Path) -> dict[str, SurveyedPose]:
    try:
        lines = [line.split() for line in _text(path).splitlines() if line.strip()]
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start})") from error
    require_at_most(path, len(lines), "sweep_rows", "rows")
    poses = {}
    for number, line in enumerate(lines, start=1):
        if len(line) != _QUATERNION_COLUMNS:
            raise InputError(f"{path}: line {number} has {len(line)} values; expected id qx qy qz qw x y z")
        qx, qy, qz, qw, x, y, z = (_finite(path, v) for v in line[1:])
        heading = math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
        poses[line[0]] = SurveyedPose(x, y, heading, z)
    return poses


def read_returns(path: Path) -> Returns:
    """Read all returns of a planar sweep: a table with columns theta_mu, range_mu, range_var."""
    rows = _read_columns(path, ("theta_mu", "range_mu", "range_var"))
    polar = np.array([[_finite(path, value) for value in row] for row in rows]).reshape(-1, 3)
    return Returns(*polar[polar[:, 1] > 0].T)


def gate_returns(path: Path, returns: Returns, max_range_m: float, max_range_var_m2: float) -> Returns:
    """Drop far returns, and bins on an edge: their range has a large variance and averages two surfaces."""
    kept = returns.kept((returns.range_m <= max_range_m) & (returns.variance_m2 <= max_range_var_m2))
    if len(kept.range_m) < _LEAST_RETURNS:
        raise InputError(
            f"{path}: {len(kept.range_m)} usable returns of {len(returns.range_m)} (range <= {max_range_m:g} m, "
            f"variance <= {max_range_var_m2:g} m2); at least {_LEAST_RETURNS} are needed"
        )
    return kept


def static_returns(
    returns: Returns, max_range_m: float, max_range_var_m2: float, min_incidence_rad: float
) -> tuple[Returns, dict[str, int]]:
    """Drop, in this order: bins on an edge, far returns, and grazing ones. Also return how many each rule dropped."""
    rules = {
        "edge": returns.variance_m2 > max_range_var_m2,
        "far": returns.range_m > max_range_m,
        "grazing": _incidence_rad(returns) < min_incidence_rad,
    }
    kept, gated = np.ones(len(returns.range_m), bool), {}
    for name, rule in rules.items():
        gated[name] = int((kept & rule).sum())
        kept &= ~rule
    return returns.kept(kept), gated


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


def read_sweep(path: Path, max_range_m: float, max_range_var_m2: float) -> np.ndarray:
    """Read a planar sweep as points (n, 2) m in the scanner's frame, without far returns and edges."""
    kept = gate_returns(path, read_returns(path), max_range_m, max_range_var_m2)
    return np.column_stack([kept.range_m * np.cos(kept.bearing), kept.range_m * np.sin(kept.bearing)])


def require_poses(poses: dict[str, SurveyedPose], sweeps: dict[str, Returns]) -> None:
    """Raise `InputError` if a sweep has no pose."""
    missing = sorted(set(sweeps) - set(poses))
    if missing:
        raise InputError(f"poses: sweep {missing[0]} has no pose (poses: {', '.join(sorted(poses))})")


def _read_columns(path: Path, columns: tuple[str, ...], optional: tuple[str, ...] = ()) -> list[list[str]]:
    try:
        reader = csv.DictReader(io.StringIO(read_csv_text(path), newline=""))
        missing = [c for c in columns if c not in (reader.fieldnames or [])]
        if missing:
            raise InputError(f"{path}: no column {', '.join(missing)}")
        rows = [
            [row.get(c) or "" for c in (*columns, *optional)] for row in islice(reader, reader_limits().sweep_rows + 1)
        ]
    except csv.Error as error:
        raise InputError(f"{path}: not CSV: a field is too long; is a quote not closed?") from error
    require_at_most(path, len(rows), "sweep_rows", "rows or more")
    return rows


def _text(path: Path) -> str:
    return read_text_bytes(path).decode("utf-8-sig")


def _finite(path: Path, text: str) -> float:
    try:
        value = plain_number(text)
    except ValueError:
        raise InputError(f"{path}: {text!r} is not a number") from None
    if not math.isfinite(value):
        raise InputError(f"{path}: {text} is not finite")
    return value
