"""The measurements of sensors: on a sweep whose answer is known, and the rates of a small world."""

import numpy as np
import pytest

from benchmarks.sensors.sweeps import compare_sweep, lost_by_incidence, spread_by_range
from minexplore.sensing.scanners import load_pattern
from minexplore.sensing.scanners.caster import shared_caster
from minexplore.world import load_world

STEP_RAD = np.radians(0.25)


@pytest.fixture(scope="module")
def world(small_world):
    return load_world(small_world)


def write_sweep(path, world, kept):
    """Write a sweep at the anchor as a table: a standard deviation of 3 cm, and only bins whose mask is true."""
    place = world.record["spawn"]["anchor_m"]
    bearing = np.arange(0, 2 * np.pi - STEP_RAD, STEP_RAD)
    level = np.column_stack([np.cos(bearing), np.sin(bearing), 0 * bearing]).astype(np.float32)
    hits = shared_caster(world, load_pattern("vz-400").range_m[1]).cast(np.array([*place, 0.5]), level)
    incidence = np.degrees(np.arccos(np.clip(hits.cosine, 0, 1)))
    rows = [f"{b},{r},0.0009" for b, r, i in zip(bearing, hits.range_m, incidence, strict=True) if kept(b, i)]
    path.write_text("\n".join(["theta_mu,range_mu,range_var", *rows]) + "\n")
    return (*place, 0.0)


def test_a_whole_sweep_has_lost_nothing_and_the_spread_that_it_states(world, tmp_path):
    pose = write_sweep(tmp_path / "sweep_a.csv", world, lambda bearing, incidence: True)
    real, simulated = compare_sweep(world, tmp_path / "sweep_a.csv", pose, 0.5)
    assert real.returned.all()
    assert all(share == 0 for bins, share in lost_by_incidence([real]) if bins)
    assert all(spread == pytest.approx(0.03) for bins, spread in spread_by_range([real]) if bins)
    assert simulated.returned.mean() > 0.98


def test_the_bins_that_are_taken_out_are_lost_where_the_world_says_and_a_wide_gap_is_blind(world, tmp_path):
    gone = lambda bearing, incidence: incidence < 60 and not 1.0 < bearing < 1.4  # noqa: E731
    pose = write_sweep(tmp_path / "sweep_a.csv", world, gone)
    real, _ = compare_sweep(world, tmp_path / "sweep_a.csv", pose, 0.5)
    shares = [share for _, share in lost_by_incidence([real])]
    assert max(shares[:2]) < 0.1
    assert shares[2] > 0.5
