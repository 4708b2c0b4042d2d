"""Long loops of a pipeline's command show what is done; short ones show nothing."""

import re
import time

import pytest

from pipeline import progress
from pipeline.progress import counted


@pytest.fixture
def soon(monkeypatch):
    monkeypatch.setattr(progress, "AFTER_S", 0.2)
    monkeypatch.setattr(progress, "_EVERY_S", 0.1)


def test_a_long_loop_prints_lines_of_what_is_done_and_what_is_left(soon, capfd):
    for _ in counted(range(5), "rock", "tiles"):
        time.sleep(0.15)
    lines = [line.strip() for line in capfd.readouterr().err.splitlines() if line.strip()]
    assert len(lines) >= 2
    assert all(re.fullmatch(r"rock: [1-5] of 5 tiles, \d\d:\d\d left", line) for line in lines)


def test_a_short_loop_prints_nothing(capfd):
    assert list(counted([3, 1, 2], "rock", "tiles")) == [3, 1, 2]
    assert capfd.readouterr().err == ""


def test_what_is_updated_by_hand_is_shown_alike(soon, capfd):
    with progress.progress("rays", 100, "rays") as shown:
        time.sleep(0.3)
        shown.update(50)
    assert "rays: 50 of 100 rays" in capfd.readouterr().err


def test_tracing_a_plan_and_assembling_a_world_show_their_steps(monkeypatch, capfd, config, tmp_path):
    from tests.mines import TEE, BuiltMine

    monkeypatch.setattr(progress, "AFTER_S", 0.0)
    monkeypatch.setattr(progress, "_EVERY_S", 0.0)
    BuiltMine(TEE, config, tmp_path / "world")
    shown = capfd.readouterr().err
    assert "contours: 4 of 4 steps" in shown
    assert "realism: 3 of 3 steps" in shown
