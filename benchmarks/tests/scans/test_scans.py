"""The benchmark of scans: sampling, comparison with the truth, and its table."""

import manifold3d
import numpy as np
import pytest

from benchmarks.scans.judge import SCANS, compare, found_again, holds, scan_mine
from benchmarks.scans.truth import FloorNetwork, _long_ends, truth_of

LONG_M = 20.0
WAY = np.column_stack([np.arange(1.0, LONG_M, 2.0), np.full(10, 2.2), np.zeros(10)])
DRIFT = manifold3d.Manifold.cube([LONG_M, 4.4, 3.2])
NETWORK = FloorNetwork(WAY, np.zeros(len(WAY)), 2.2 * (np.abs(WAY[:, 0] - LONG_M / 2) < 3), (2, 0, 1))
ROW = {"seed": 0, "kind": "level cave", "floor_m": 0.01, "wall_m": 0.02, "iou": 0.99, "things": 2}


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


@pytest.mark.slow
def test_a_volume_that_is_too_high_is_measured(found):
    figures = compare(DRIFT.scale([1, 1, 1.2]), found, np.random.default_rng(0))
    assert figures["iou"] < 0.9
    assert figures["wall_m"] > 0.1


def test_a_scan_holds_only_with_all_figures_and_the_same_network():
    good = ROW | {"network": (2, 1, 1), "found": [2, 1, 1]}
    assert holds(good)
    for bad in ({"floor_m": 0.04}, {"wall_m": 0.06}, {"iou": 0.96}, {"found": [3, 1, 1]}):
        assert not holds(good | bad)
    assert not holds(ROW)


def test_the_table_has_the_worst_figures_of_each_kind():
    rows = [ROW | {"network": (2, 1, 1), "found": (2, 1, 1)}, {"kind": "level cave", "problem": "none"}]
    assert "| all | 2 | 1 | 1.0 | 2.0 | 0.990 | 1 of 2 | 2 of 4 |" in SCANS.table(rows)


@pytest.mark.parametrize(("half_m", "stub_m", "ends"), [(2.0, 2.0, 2), (2.0, 8.0, 3), (8.0, 8.0, 2), (8.0, 14.0, 3)])
def test_corners_of_rooms_are_no_dead_ends_and_drifts_are(half_m, stub_m, ends):
    legs = [("a", "j", 30.0), ("b", "j", 25.0), ("j", "c", stub_m)]
    found = {"legs": [{"start": one, "end": two, "length_m": length} for one, two, length in legs]}
    assert _long_ends(found, dict.fromkeys("abc", 1.0) | {"j": half_m}) == ends


def test_mines_take_turns_between_level_and_with_heights():
    (level, one), (high, two) = truth_of(0), truth_of(1)
    assert level.startswith("level")
    assert high == "wandering decline"
    assert np.ptp([one.bounding_box()[2], one.bounding_box()[5]]) == pytest.approx(3.2)
    assert two.bounding_box()[5] - two.bounding_box()[2] > 3.5
