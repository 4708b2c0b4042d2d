"""The page of deep mines, and a small one measured."""

import dataclasses
import json

import pytest

from benchmarks.speed.stage_costs import STAGES, Costs
from benchmarks.speed.time_deep import Deep, measure_survey, tables
from tests.heights import UNDER, table
from tests.project import Project


def deep(km, seconds, **figures):
    costs = Costs(
        stages_s={name: seconds / 8 for name in STAGES} | {"validation": 3 * seconds / 8},
        peak_mb=dict.fromkeys(STAGES, 900.0) | {"compile3d": 4200.0},
        load_s=4.0,
        env_peak_mb=512.0,
        steps_per_s=2500.0,
        reset_ms=0.05,
    )
    row = Deep(km, 20, 990.0 * km, 950.0, 41, int(300 * km), True, costs)
    return dataclasses.replace(row, **figures)


def test_the_page_has_a_row_a_mine_the_shorter_first_in_every_table():
    text = tables([deep(80, 792.0, certificate=False), deep(40, 396.0)])
    short = "| 40 | 20 | 39.6 | 950 | 41 | 12,000 | 396 | 10.0 | 4.2 | compile3d | holds |"
    long = "| 80 | 20 | 79.2 | 950 | 41 | 24,000 | 792 | 10.0 | 4.2 | compile3d | **broken** |"
    assert text.index(short) < text.index(long)
    assert "| 39.6 | 49.5 | 49.5 | 49.5 | 49.5 | 49.5 | 148.5 |" in text
    assert "| 79.2 | 0.90 | 0.90 | 4.20 | 0.90 | 0.90 | 0.90 |" in text
    assert "| 79.2 | 4.0 | 512 | 2,500 | 0.050 |" in text


def test_a_result_is_read_back_as_it_was_written():
    row = deep(40, 396.0)
    assert Deep.of(json.loads(json.dumps(dataclasses.asdict(row)))) == row


@pytest.mark.slow
def test_a_small_mine_is_built_as_new_builds_it_and_measured(tmp_path):
    row = measure_survey(Project(tmp_path, tiny=False), "small", table(UNDER), 0.2, 2)
    assert row.certificate
    assert (row.storeys, round(row.depth_m)) == (2, 9)
    assert 180 < row.drift_m < 260
    assert set(row.costs.stages_s) == set(row.costs.peak_mb) == set(STAGES)
    assert all(seconds > 0 for seconds in row.costs.stages_s.values())
    assert row.costs.steps_per_s > 0
