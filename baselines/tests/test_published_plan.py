"""The page of the published plan, which needs a file that this repository does not hold."""

import shutil

import numpy as np
import pytest

from baselines.base.result_file import RESULTS, read_results
from baselines.scoring.bounds import read_bounds
from benchmarks.comparisons import published_plan


def test_a_missing_plan_is_named_with_the_command_that_fetches_it(project):
    done = project.module("benchmarks.comparisons.published_plan")
    assert done.returncode == 2
    assert done.stderr == "published-plan: data/raw/plan.jpg: missing; `make data` fetches it\n"


def test_the_page_begins_with_the_policy_that_sees_most(tmp_path, monkeypatch):
    monkeypatch.setattr(published_plan, "_FOLDER", tmp_path)
    (tmp_path / "results").mkdir()
    for policy in ("random", "nearest-frontier"):
        shutil.copy(RESULTS / "ChileanMine-v0" / f"{policy}.jsonl", tmp_path / "results")
    bound = read_bounds()["MineXplore/ChileanMine-v0"].model_copy(update={"found": [1234]})
    text = published_plan.tables(["random", "nearest-frontier"], bound)
    assert "sees 1,234." in text
    rows = text.splitlines()[-2:]
    assert [row.split(" | ")[0] for row in rows] == ["| nearest-frontier", "| random"]
    _, episodes = read_results(tmp_path / "results" / "nearest-frontier.jsonl")
    ends = np.sort([episode.seen[-1] / bound.most[-1] for episode in episodes])
    assert float(rows[0].split(" | ")[3].split(" %")[0]) == pytest.approx(100 * ends[5:15].mean(), abs=0.05)
