"""The page of growing mines: exponents, limits, and what is not measured."""

import dataclasses

import pytest

from baselines.base.markdown import with_table
from benchmarks.speed.growth import PAGE, Grown, exponent, faults, points_of, tables
from tests.project import ROOT


def grown(km, seconds, **figures):
    row = Grown(
        km=km,
        kind="light",
        drift_m=1000.0 * km,
        loops=3,
        parts=int(180 * km),
        bytes=int(5e5 * km),
        certificate=True,
        stages_s={"contours": seconds / 2, "validation": seconds / 2},
        peak_mb={"contours": 700.0, "validation": 900.0},
        load_s=0.2,
        env_peak_mb=150.0,
        steps_per_s=3000.0,
        reset_ms=0.05,
    )
    return dataclasses.replace(row, **figures)


def test_the_exponent_is_that_of_a_power_law_from_three_kilometres_on():
    rows = [grown(1, 400.0), *(grown(km, 5 * km**1.1) for km in (3, 10, 30))]
    assert exponent(points_of(rows)) == pytest.approx(1.1)


def test_each_missed_limit_is_named_with_its_mine():
    assert faults([grown(km, 5.0 * km) for km in (1, 3, 10)]) == []
    rows = [grown(1, 5), grown(3, 15), grown(10, 90, certificate=False, peak_mb={"survey": 9000.0}, steps_per_s=2000.0)]
    assert faults(rows) == [
        "10 km: the certificate does not hold",
        "10 km: 9000 MB in survey",
        "exponent 1.49, limit 1.15",
        "10 km: 2000 steps/s of 3000",
    ]


def test_a_coal_mine_has_limits_of_time_and_memory_and_a_table_of_its_own():
    rows = [grown(218, 700.0, kind="coal", peak_mb={"contours": 9000.0}), grown(20, 30.0, kind="coal")]
    assert faults(rows) == ["218 km: 9000 MB in contours", "218 km: 700 s, limit 600"]
    text = tables([grown(1, 9.0), *rows])
    assert text.index("## A coal mine") < text.index("| 20.00 | 3 | 30.0") < text.index("| 218.00 | 3 | 700.0")
    assert tables([], f"{text}\n").count("| 218.00 |") == 1


def test_the_page_names_the_sizes_that_are_not_measured():
    text = tables([grown(km, 5.0 * km) for km in (1, 3, 10)])
    assert "power of 1.00 (limit 1.15)" in text
    assert "Not measured yet: 30 km, 100 km." in text
    assert "| 10.00 | 3 | 50.0 | 5.00 | 900 | validation | 1,800 | 0.180 | 5.00 | holds |" in text


def test_mines_that_are_not_measured_now_keep_their_rows_on_the_page():
    before = (ROOT / PAGE).read_text()
    lines = before.splitlines()
    same = with_table(before, tables([], before)).splitlines()
    assert all(new.startswith("Measured on") for old, new in zip(lines, same, strict=True) if old != new)
    rows = [grown(10, 60.0, drift_m=8720.0), grown(1, 80.0, drift_m=1130.0, kind="rock")]
    again = with_table(before, tables(rows, before))
    changed = [(old, new) for old, new in zip(lines, again.splitlines(), strict=True) if old != new]
    assert [new.split(" | ")[:3] for _, new in changed if new.startswith("|")] == [
        ["| 8.72", "3", "60.0"],
        ["| 1.13", "3", "80.0"],
    ]
    assert [old[:6] for old, _ in changed if old.startswith("|")] == ["| 8.72", "| 1.13"]
