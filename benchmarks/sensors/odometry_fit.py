"""Fit the errors of wheel odometry to the real log: `python -m benchmarks odometry-fit`, from what `make data` fetches.

The log is the travel of both sides of a Husky A200 on its way between two surveyed poses; the rows are the travel since
the row before.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np

from minexplore.sensing.odometry import OdometryFit

OUT = Path("minexplore/sensing/odometry.json")
WHEEL_BASE_M = 0.545  # of the log's robot, by the dataset
_ROBOT_STANDS_M = 1e-6  # of travel in a row
_SMOOTH = 21  # rows, 2 s: what turns slower is steering


def fit_odometry(times_s: np.ndarray, travel_m: np.ndarray, start: np.ndarray, end: np.ndarray) -> OdometryFit:
    """Return the errors of odometry.

    Parameters
    ----------
    times_s : (n,)
    travel_m : (n, 2)
        Left and right, since the row before.
    start, end : (3,), m and rad
        Surveyed poses before and after. The robot drives nearly straight between them, so that their distance is the
        way that it went.
    """
    way_m, turned = float(np.linalg.norm(end[:2] - start[:2])), float(end[2] - start[2])
    travel = travel_m.mean(axis=1)
    counted = float(travel.sum())
    turn = (travel_m[:, 1] - travel_m[:, 0]) / WHEEL_BASE_M
    moving = travel > _ROBOT_STANDS_M
    smooth = np.convolve(turn, np.ones(_SMOOTH) / _SMOOTH, mode="same")
    noise = (turn - smooth)[moving]
    return OdometryFit(
        slip=1 - way_m / counted,
        heading_drift_radpm=abs(float(turn.sum()) - turned) / counted,
        heading_noise_rad_rtm=float(noise.std() / np.sqrt(travel[moving].mean())),
        resolution_m=_resolution_m(travel_m),
    )


def _resolution_m(travel_m: np.ndarray) -> float:
    """Return the smallest step between the values of a log."""
    steps = np.diff(np.unique(np.round(travel_m.ravel(), 9)))
    return float(np.round(steps[steps > _ROBOT_STANDS_M].min(), 6))


def read_log(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return times (n,) s and travel (n, 2) m of a wheel log."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    return table["times"], np.column_stack([table["left"], table["right"]])


def read_pose(path: Path, name: str) -> np.ndarray:
    """Return a surveyed pose (3,): x, y, m, and heading, rad."""
    rows = [line.split(",") for line in path.read_text().splitlines()]
    return next(np.array(row[1:4], dtype=float) for row in rows if row[0] == name)


def as_record(fit: OdometryFit) -> dict[str, object]:
    """Return what the kept file holds: the fit, rounded, and where it comes from."""
    rounded = {name: float(f"{value:.3g}") for name, value in vars(fit).items()}
    source = (
        "encoder_01M.csv of the Chilean underground mine dataset (doi 10.1177/0278364916679497), driven between the "
        "surveyed poses 00S and 01S; written by `python -m benchmarks odometry-fit`. One drive: slip and drift have no "
        "spread of their own, and the drift is used as a standard deviation"
    )
    return {"source": source, "fit": rounded}


def main() -> int:
    """Fit, write the file, and print it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=Path("data/raw"), help="folder of the log and the poses")
    parser.add_argument("--out", type=Path, default=OUT)
    arguments = parser.parse_args()
    log, poses = arguments.data / "encoder_01M.csv", arguments.data / "scan_poses.csv"
    for path in (log, poses):
        if not path.is_file():
            print(
                f"odometry-fit: {path}: no such file; `make data` fetches it, --data names another folder",
                file=sys.stderr,
            )
            return 2
    fit = fit_odometry(*read_log(log), read_pose(poses, "00S"), read_pose(poses, "01S"))
    text = json.dumps(as_record(fit), indent=2) + "\n"
    arguments.out.write_text(text)
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
