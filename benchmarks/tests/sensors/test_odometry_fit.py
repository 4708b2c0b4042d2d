"""The fit of odometry: on logs with known errors, and the kept numbers from the real log."""

import json

import numpy as np
import pytest

from benchmarks.sensors.odometry_fit import OUT, as_record, fit_odometry, read_log, read_pose


def test_the_errors_of_a_made_log_are_found():
    rng, count = np.random.default_rng(0), 2000
    ahead = np.full(count, 0.05)
    turn = 0.02 * ahead + 0.01 * np.sqrt(ahead) * rng.standard_normal(count)
    travel = np.column_stack([ahead - turn * 0.545 / 2, ahead + turn * 0.545 / 2])
    fit = fit_odometry(np.arange(count) * 0.1, travel, np.zeros(3), np.array([95.0, 0, 0]))
    assert fit.slip == pytest.approx(0.05)
    assert fit.heading_drift_radpm == pytest.approx(0.02, rel=0.15)
    assert fit.heading_noise_rad_rtm == pytest.approx(0.01, rel=0.1)


def test_the_kept_numbers_are_those_of_the_real_log(shared_mine):
    poses = shared_mine / "scan_poses.csv"
    fit = fit_odometry(*read_log(shared_mine / "encoder_01M.csv"), read_pose(poses, "00S"), read_pose(poses, "01S"))
    assert json.loads(OUT.read_text()) == as_record(fit)
