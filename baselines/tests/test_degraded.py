"""Drives by worse senses: kept, read back, and shown as points lost."""

import pytest

from baselines.base.errors import BaselineError
from baselines.scoring.degraded import DRIVEN, Drives, degraded_table, keep_drives, read_degraded
from benchmarks.sensors.sensing_loss import all_senses, explore


def drives(coverage: float, off_m: float = 0.0) -> Drives:
    return Drives(inputs_sha256="a" * 64, episodes=3, coverage=coverage, collisions=0.0, off_m=off_m)


def test_what_is_kept_is_read_back_and_a_broken_file_is_named(tmp_path):
    path = tmp_path / "degraded.json"
    keep_drives("env", "a", "ideal", drives(0.5), path)
    keep_drives("env", "a", "dusty", drives(0.25), path)
    assert read_degraded(path)["env"]["a"]["dusty"].coverage == 0.25
    path.write_text('{"env": 3}')
    with pytest.raises(BaselineError, match=r"degraded\.json"):
        read_degraded(path)


def test_the_table_gives_points_lost_and_leaves_out_a_policy_that_is_not_driven_by_all_senses():
    full = {"ideal": drives(0.5), "odometry": drives(0.4, 12.0), "dusty": drives(0.05)}
    table = degraded_table({"low": full, "high": full | {"ideal": drives(0.7)}, "new": {"ideal": drives(0.9)}})
    lines = table.splitlines()
    assert lines[2] == "| high | 3 | 70.0 % | 30.0 | 65.0 | 12.0 |"
    assert lines[3] == "| low | 3 | 50.0 % | 10.0 | 45.0 | 12.0 |"
    assert len(lines) == 6
    assert lines[5].startswith("Not measured: reactive, wall-following, nearest-frontier, ")


def test_the_table_of_all_explorers_names_none_that_is_not_measured():
    full = {"ideal": drives(0.5), "dusty": drives(0.05)}
    assert "Not measured" not in degraded_table(dict.fromkeys(DRIVEN, full))
    but_one = dict.fromkeys([name for name in DRIVEN if name != "two-level"], full)
    assert degraded_table(but_one).splitlines()[-1] == "Not measured: two-level."


def test_episodes_of_the_same_inputs_are_not_driven_again_and_other_senses_are_other_inputs(short_id):
    first = explore("wall-following", short_id, [0, 1], {})
    assert first is not None
    assert explore("wall-following", short_id, [0, 1], {}, first.inputs_sha256) is None
    dusty = explore("wall-following", short_id, [0, 1], all_senses()["dusty"], first.inputs_sha256)
    assert dusty is not None
    assert dusty.inputs_sha256 != first.inputs_sha256
    assert dusty.coverage < first.coverage
