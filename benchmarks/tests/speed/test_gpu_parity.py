"""How `python -m benchmarks parity-gpu` judges; these tests need neither Warp nor a GPU."""

import sys

import pytest

from benchmarks.speed.gpu_parity import main
from benchmarks.speed.gpu_parity_page import rows, tables
from tests.project import ROOT

LOOKS = {"rays": 100, "largest_difference_m": 2e-5, "rays_beyond_1_mm": 0, "cells_that_differ": 0}
SOUND = {"outside": 0, "not_finite": 0, "overflows": 0}
STEPS = {
    "control_steps": 1000,
    "with_contact": 40,
    "flags_that_differ": 1,
    "rewards_compared": 990,
    "largest_reward_difference": 1e-6,
    "places_beyond_0.1_mm": 80,
    "largest_distance_m": 0.004,
    **SOUND,
}
STRESS = {"contacts": 500, "control_steps": 2000, "least_clearance_m": 0.2, "largest_iterations": 9, **SOUND}
EPISODES = {"episodes": 40, "cpu": [[k, k / 40] for k in range(40)], "warp": [[k + 0.5, k / 40] for k in range(40)]}


def test_every_limit_that_is_broken_is_shown():
    good = {"looks": LOOKS, "steps": STEPS, "stress": STRESS, "episodes-wall-following": EPISODES}
    assert all(row.holds for row in rows(good))
    shifted = EPISODES | {"warp": [[k + 40, k / 40] for k in range(40)]}
    broken = [
        ("looks", LOOKS | {"rays_beyond_1_mm": 1}),
        ("looks", LOOKS | {"cells_that_differ": 1}),
        ("steps", STEPS | {"flags_that_differ": 2}),
        ("steps", STEPS | {"largest_reward_difference": 1e-3}),
        ("steps", STEPS | {"overflows": 1}),
        ("stress", STRESS | {"largest_iterations": 20}),
        *(("stress", STRESS | {name: 1}) for name in SOUND),
        ("episodes-wall-following", shifted),
    ]
    for name, part in broken:
        lines = rows(good | {name: part})
        assert [row.holds for row in lines].count(False) == 1, part
        assert tables(lines, "CPU", 4, "Mine").count("**missed**") == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--policy", "nobody"], "policy = 'nobody': valid choices are"),
        (["--env", "Nowhere"], "Nowhere"),
        (["--robots", "0"], "--robots 0: want 1 or more"),
    ],
)
def test_a_wrong_argument_is_named_before_anything_is_measured(monkeypatch, capsys, words, message):
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", ["gpu_parity", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert message in capsys.readouterr().err
