"""What a Husky's wheel log says of its drive: `python -m benchmarks wheel-log` prints the fields of `HuskyParams`.

The log is that of the way from scan 00S to scan 01S of the Chilean mine, both of which were surveyed: drive nM ends
at scan nS. The way to 02S fits worse (its heading is off by 0.048 rad, this one's by 0.029). The logs 26M and 28M,
which are not kept here, fit to 25S-26S and 27S-28S alone, with the same scale (0.966 and 0.967). The log holds the
way (m) that the wheels of either side made between two times (s).
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.sensors.odometry_fit import WHEEL_BASE_M, read_log, read_pose

_CONTROL_S = 0.1  # the log's period and a control step
_STEADY = (0.8, 1.2)  # of that period: other times are late, and their speeds wrong
_STEP = 0.005  # the most that a scale changes in one of Newton's steps
_MEAN_STEPS = 10  # a second: the log's ticks beat with its period, so that speeds of single steps differ by 40 %


@dataclass(frozen=True)
class WheelLog:
    """Times (n,) s and the ways (n,) m that the left and the right wheels made since the time before."""

    time_s: np.ndarray
    left_m: np.ndarray
    right_m: np.ndarray


@dataclass(frozen=True)
class DriveFit:
    """The fitted fields of `HuskyParams`, and by how much the heading then misses the survey's at the end (rad)."""

    travel_scale: float
    side_ratio: float
    speed_noise_mps: float
    turn_noise_radps: float
    heading_error_rad: float


def read_drive(folder: Path) -> tuple[WheelLog, np.ndarray]:
    """Return a log, and the surveyed poses (2, 3), x and y m and heading rad, where it begins and ends."""
    time_s, travel_m = read_log(folder / "encoder_01M.csv")
    poses = np.array([read_pose(folder / "scan_poses.csv", name) for name in ("00S", "01S")])
    return WheelLog(time_s, *travel_m.T), poses


def end_of(log: WheelLog, start: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Return the pose (3,) that a log leads to from a pose (3,), with a scale (2,) for the wheels of either side."""
    left, right = log.left_m * scales[0], log.right_m * scales[1]
    heading = start[2] + np.cumsum((right - left) / WHEEL_BASE_M)
    middle = heading - (right - left) / WHEEL_BASE_M / 2
    way = (left + right) / 2
    return np.array([start[0] + way @ np.cos(middle), start[1] + way @ np.sin(middle), heading[-1]])


def fit(log: WheelLog, poses: np.ndarray) -> DriveFit:
    """Return the scales with which the log leads from the first surveyed place to the second, and its noise."""
    scales = np.ones(2)
    for _ in range(200):  # Newton's steps for two equations, short ones: a way of many turns is not linear
        miss = end_of(log, poses[0], scales)[:2] - poses[1, :2]
        steps = [end_of(log, poses[0], scales + 1e-6 * side)[:2] - poses[1, :2] for side in np.eye(2)]
        step = np.linalg.solve((np.array(steps) - miss).T / 1e-6, miss)
        scales = scales - step * min(0.5, _STEP / max(np.abs(step).max(), 1e-12))
    heading = end_of(log, poses[0], scales)[2] - poses[1, 2]
    return DriveFit(float(scales.mean()), float(scales[1] / scales[0]), *_noise(log), float(heading))


def _noise(log: WheelLog) -> tuple[float, float]:
    """Return the noise of speed (m/s) and turn rate (rad/s) of one control step, by second differences.

    A steady change of speed has none. Speeds are means of a second, whose noise is that of a step by the square root of
    ten; sides beat alike, so turn rates are those of single steps.
    """
    period = np.diff(log.time_s, prepend=np.nan)
    steady = (period > _STEADY[0] * _CONTROL_S) & (period < _STEADY[1] * _CONTROL_S)
    moving = steady & (log.left_m + log.right_m > 0)
    turn = (log.right_m - log.left_m) / WHEEL_BASE_M / period
    kernel = np.ones(_MEAN_STEPS) / _MEAN_STEPS
    mean = np.convolve((log.left_m + log.right_m) / 2, kernel, "valid") / np.convolve(
        np.nan_to_num(period), kernel, "valid"
    )
    whole = np.convolve(moving, kernel, "valid") > 1 - 1e-9
    return (
        _spread(mean[::_MEAN_STEPS], whole[::_MEAN_STEPS]) * np.sqrt(_MEAN_STEPS),
        _spread(turn, moving),
    )


def _spread(values: np.ndarray, valid: np.ndarray) -> float:
    """Return the standard deviation of white noise in values (n,), by the median of their second differences."""
    inner = valid[:-2] & valid[1:-1] & valid[2:]
    second = (values[:-2] - 2 * values[1:-1] + values[2:])[inner]
    return float(1.4826 * np.median(np.abs(second - np.median(second))) / np.sqrt(6))


def main() -> None:
    """Print the fit."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks wheel-log", description=__doc__)
    parser.add_argument("--data", type=Path, default=Path("data/raw"), help="folder of the log and the poses")
    found = fit(*read_drive(parser.parse_args().data))
    print(f"travel_scale = {found.travel_scale:.3f}: way over ground by metre of wheel")
    print(f"side_ratio = {found.side_ratio:.4f}: of the right side's to the left side's")
    print(f"speed_noise_mps = {found.speed_noise_mps:.3f}")
    print(f"turn_noise_radps = {found.turn_noise_radps:.4f}")
    print(f"then the heading misses the survey's by {found.heading_error_rad:.3f} rad at the end")


if __name__ == "__main__":
    main()
