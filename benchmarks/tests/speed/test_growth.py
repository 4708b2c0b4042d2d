"""The page of growing mines: exponents and limits, and a small mine measured."""

import pytest

from benchmarks.speed.growth import LONG, VOLUME, exponent, measure_file, row_of
from benchmarks.speed.stage_costs import STAGES
from tests.heights import UNDER, table
from tests.project import Project


def grown(km, seconds, style=LONG, kind="light", **figures):
    row = {"case": [style, kind, km], "drift_m": 1000.0 * km, "parts": 180, "bytes": 5_000_000, "certificate": True}
    row |= {"stages_s": {"contours": seconds / 2, "validation": seconds / 2}}
    row |= {"peak_mb": {"contours": 700.0, "validation": 900.0}, "load_s": 0.2, "env_peak_mb": 150.0}
    return row | {"steps_per_s": 3000.0, "reset_ms": 0.05} | figures


def test_the_exponent_is_that_of_a_power_law_of_the_light_level_mines_from_three_kilometres_on():
    others = [grown(1, 400.0), grown(10, 9000.0, kind="rock"), grown(10, 900.0, style=VOLUME)]
    assert exponent([*others, *(grown(km, 5 * km**1.1) for km in (3, 10, 30))]) == pytest.approx(1.1)
    assert exponent(others) is None


@pytest.mark.slow
def test_a_small_mine_of_two_levels_is_built_as_new_builds_it_and_measured(tmp_path):
    (tmp_path / "small.csv").write_text(table(UNDER))
    costs, root = measure_file(tmp_path / "small.csv", Project(tmp_path / "project", tiny=False))
    row = row_of(root)
    assert row["certificate"]
    assert 180 < row["drift_m"] < 260
    assert set(costs.stages_s) == set(costs.peak_mb) == set(STAGES)
    assert all(seconds > 0 for seconds in costs.stages_s.values())
    assert costs.steps_per_s > 0
