"""Large volumes: a mine of a stated length is built and each step is timed."""

import pytest

from benchmarks.comparisons.volume.large import STEPS, measure, network_of_size, table_of


def test_a_mine_of_one_kilometre_is_built_and_the_table_has_its_length_and_the_seconds_of_each_step(tmp_path):
    row = measure("mine 1")
    assert row["length_m"] == pytest.approx(1000, rel=0.4)
    assert row["length_m"] == network_of_size("mine", 1, tmp_path).lengths_m.sum()
    assert row["parts"] > 0.5 * row["facets"] / 4
    assert row["intrusion_mm"] < 0.01
    assert all(row[step] > 0 for step in STEPS)
    assert f"| mine | {row['length_m']:,.0f} |" in table_of([row])
