"""Work on several cores."""

import os
import threading

import pytest

from pipeline.errors import ArtifactError
from pipeline.parallel import in_shares, together
from pipeline.params.floor_rules import FloorRules, floor_rules, reading_by


def test_functions_run_at_the_same_time_and_their_results_are_in_order():
    both = threading.Barrier(2, timeout=20)  # each waits for the other one
    assert together(lambda: (both.wait(), "a")[1], lambda: (both.wait(), "b")[1]) == ["a", "b"]


def test_the_error_is_that_of_the_first_function_that_failed_once_all_have_ended():
    ended = []

    def fails(name):
        ended.append(name)
        raise ArtifactError(name)

    with pytest.raises(ArtifactError, match=r"^one$"):
        together(lambda: fails("one"), lambda: fails("two"), lambda: ended.append("three"))
    assert sorted(ended) == ["one", "three", "two"]


def test_a_function_sees_the_rules_of_its_caller():
    rules = FloorRules(flat_step_m=2.5)
    with reading_by(rules):
        assert together(floor_rules) == [rules]


def test_shares_are_in_order_and_of_several_threads(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    both = threading.Barrier(2, timeout=20)

    def work(first, end):
        if first in (0, 125):
            both.wait()
        return list(range(first, end))

    assert [number for some in in_shares(work, 1000) for number in some] == list(range(1000))
    assert in_shares(work, 0) == []
    assert in_shares(lambda first, end: (first, end), 9, least=5) == [(0, 9)]  # too few for two


def test_work_is_one_share_on_one_core(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    assert in_shares(lambda first, end: (first, end), 100) == [(0, 100)]


def test_a_refusal_of_any_share_comes_with_its_message(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 2)

    def refuse(first, end):
        if first:
            raise ArtifactError("mine.xml: no rock")

    with pytest.raises(ArtifactError, match=r"^mine\.xml: no rock$"):
        in_shares(refuse, 100)
