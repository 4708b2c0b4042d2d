"""What explorers see of mines with heights, by a bound."""

import pytest

from benchmarks.comparisons.volume import explorers
from tests.heights import RAMP


@pytest.mark.slow
def test_explorers_that_plan_see_more_of_a_ramp_than_random_ones_and_none_passes_the_bound(monkeypatch):
    monkeypatch.setattr(explorers, "random_legs", lambda seed: ("ramp", RAMP))
    monkeypatch.setattr(explorers, "NAMES", ("random", "nearest-frontier"))
    row = explorers.judge(0)
    assert explorers.EXPLORED.holds(row), row
    assert row["bounds"] == sorted(row["bounds"])
    assert row["bounds"][-1] <= row["cells"]
    assert row["random"][-1] < row["nearest-frontier"][-1]
    assert max(row["random"] + row["nearest-frontier"]) <= 1.0
    assert row["nearest-frontier"][-1] > 0.95


def test_a_mine_that_is_refused_has_its_reason_and_does_not_count(monkeypatch):
    monkeypatch.setattr(explorers, "random_legs", lambda seed: ("none", {"A": [("a", 0, 0, 0)]}))
    row = explorers.judge(0)
    assert not explorers.EXPLORED.holds(row)
    assert "a" in row["problem"]
    good = {"case": 1, "kind": "none", "cells": 10, "random": [0.1, 0.2, 0.3]}
    assert explorers.shares([{"case": 0, **row}, good], "random") == "10.0, 20.0, 30.0"
    assert explorers.note([{"case": 0, **row}, good]).startswith("- mine 0: ")
