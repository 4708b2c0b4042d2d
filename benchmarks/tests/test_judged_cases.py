"""Pages whose cases are judged one by one: their table, their rows that are kept, and their exit code."""

import sys

import pytest

from benchmarks import judged_cases
from benchmarks.judged_cases import CODE, JudgedCases, largest, span


def cases(**changed):
    judged = []

    def judge(case):
        judged.append(case)
        return {"kind": "odd" if case[0] % 2 else "even", "off_mm": 2.0 * case[0]}

    page = JudgedCases(
        **{
            "name": "cases",
            "cases": [(number, "a") for number in range(4)],
            "judge": judge,
            "holds": lambda row: row["off_mm"] < 5,
            "groups": lambda row: [row["kind"]],
            "of": "kind",
            "columns": {"cases": len, "off, um": largest("off_mm", ".0f", 1000.0), "span": span("off_mm")},
            **changed,
        }
    )
    return page, judged


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.setattr(judged_cases, "PAGES", tmp_path)
    monkeypatch.chdir(tmp_path)

    def go(page, code, *words):
        monkeypatch.setenv(CODE, code)
        monkeypatch.setattr(sys, "argv", ["cases", "--jobs", "1", *words])
        return page.run("About.")

    return go


def test_a_run_goes_on_where_one_of_the_same_code_stopped_and_writes_the_page_of_the_whole_sample(tmp_path, run):
    page, judged = cases()
    assert run(page, "one", "--count", "2") == 0
    assert not (tmp_path / "cases.md").exists()
    assert run(page, "one") == 2  # 6 mm is too much
    assert judged == [(0, "a"), (1, "a"), (2, "a"), (3, "a")]
    assert "| all | 4 | 6000 | 0 to 6 |" in (tmp_path / "cases.md").read_text()
    run(page, "two")
    assert len(judged) == 8
