"""The benchmark of scans: sampling, comparison with the truth, and its table."""

import manifold3d
import numpy as np
import pytest

from benchmarks.scans.judge import compare, found_again, scan_mine
from benchmarks.scans.truth import FloorNetwork, _long_ends

LONG_M = 20.0
WAY = np.column_stack([np.arange(1.0, LONG_M, 2.0), np.full(10, 2.2), np.zeros(10)])
DRIFT = manifold3d.Manifold.cube([LONG_M, 4.4, 3.2])
NETWORK = FloorNetwork(WAY, np.zeros(len(WAY)), 2.2 * (np.abs(WAY[:, 0] - LONG_M / 2) < 3), (2, 0, 1))


@pytest.fixture(scope="module")
def scan():
    return scan_mine(DRIFT, NETWORK, np.random.default_rng(0), 150.0)


@pytest.fixture(scope="module")
def found(scan):
    return found_again(scan.points_m)


def test_a_scan_has_no_more_points_than_it_may_and_lies_on_the_rock_or_the_things(scan):
    area = 2 * (LONG_M * 4.4 + LONG_M * 3.2 + 4.4 * 3.2)
    assert 0.3 * 150 * area < len(scan.points_m) < 1.3 * 150 * area
    low, high = np.array([0, 0, 0]), np.array([LONG_M, 4.4, 3.2])
    on_rock = np.minimum(np.abs(scan.points_m - low), np.abs(scan.points_m - high)).min(axis=1) < 0.1
    on_thing = np.linalg.norm(scan.points_m[:, None, :2] - scan.things_m[:, :2], axis=2).min(axis=1) < 2.5
    assert (on_rock | on_thing).all()


@pytest.mark.slow
def test_a_drift_with_a_person_and_a_vehicle_in_it_is_found_again(found):
    figures = compare(DRIFT, found, np.random.default_rng(0))
    assert figures["floor_m"] <= 0.03
    assert figures["wall_m"] <= 0.05
    assert figures["iou"] >= 0.97


@pytest.mark.parametrize(("half_m", "stub_m", "ends"), [(2.0, 2.0, 2), (2.0, 8.0, 3), (8.0, 8.0, 2), (8.0, 14.0, 3)])
def test_corners_of_rooms_are_no_dead_ends_and_drifts_are(half_m, stub_m, ends):
    legs = [("a", "j", 30.0), ("b", "j", 25.0), ("j", "c", stub_m)]
    found = {"legs": [{"start": one, "end": two, "length_m": length} for one, two, length in legs]}
    assert _long_ends(found, dict.fromkeys("abc", 1.0) | {"j": half_m}) == ends
