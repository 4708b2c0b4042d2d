"""A user's own mine, registered from artifacts/worlds, in every command of the benchmark."""

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from baselines.pages.split_page import UNVERIFIED_HEADING
from tests.mines import end_build
from tests.project import eventually
from tests.sandbox import needs_sandbox

STILL_RESULTS = Path("baselines/results/my-mine-v0/still.Still.jsonl")
STILL = """
import numpy as np


class Still:
    def __init__(self, count, task, robot):
        self.count = count

    def reset(self, robots, seeds):
        pass

    def act(self, observation, info):
        # west, out of the mud, which moves a robot at rest
        x, _, yaw = info["pose_m_rad"].T
        error = (np.pi - yaw + np.pi) % (2 * np.pi) - np.pi
        driving = x > 15.0
        forward = driving & (np.abs(error) < 0.3)
        return np.column_stack([forward, np.where(driving, np.clip(2 * error, -1, 1), 0.0)])
"""


@pytest.fixture(scope="module")
def own(tee, unbuilt, tmp_path_factory):
    """Return a copy of the project with the T-junction as a mine of the user's own."""
    project = unbuilt.copy(tmp_path_factory.mktemp("own") / "mine")
    shutil.copytree(tee.bundle, project.folder / "artifacts/worlds/my-mine/realism/world")
    end_build(project.folder / "artifacts/worlds/my-mine")
    shutil.rmtree(project.folder / "baselines/results")
    return project


@pytest.fixture
def own_short(own, tmp_path):
    """Return a copy of the project with the own mine, in which an episode has 300 steps instead of 6000."""
    project = own.copy(tmp_path / "mine")
    task = project.folder / "minexplore/task.py"
    text = task.read_text()
    assert "max_steps: int = 6000" in text
    task.write_text(text.replace("max_steps: int = 6000", "max_steps: int = 300"))
    return project


# Commands one after another in a process that loads its libraries once.
COMMANDS = """
import json, runpy, sys

for words in json.loads(sys.argv[1]):
    sys.argv = words
    try:
        runpy.run_module(words[0], run_name="__main__", alter_sys=True)
    except SystemExit as end:
        if end.code:
            raise
"""


def python(project, *commands):
    """Run commands and return their output. The first word of each command is a module."""
    done = project.run(sys.executable, "-c", COMMANDS, json.dumps(commands))
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
@needs_sandbox
def test_an_own_mine_is_evaluated_scored_and_listed(own_short):
    own = own_short
    said = python(
        own,
        evaluation_of_still(own),
        ["baselines.score", str(STILL_RESULTS), "--rerun", "1", "--policy", "still:Still"],
        ["baselines.leaderboard"],
    )
    assert "1 of 20 episodes driven again, all figures are equal" in said
    assert "still.Still in MineXplore/my-mine-v0, 20 seeds" in said
    page = (own.folder / "LEADERBOARD.md").read_text()
    assert "## MineXplore/my-mine-v0" in page
    assert "| still.Still | 20 |" in page.split(UNVERIFIED_HEADING)[1]


def evaluation_of_still(own):
    """Write a policy that stands still, whose episodes are short; return the command that evaluates it."""
    (own.folder / "still.py").write_text(STILL)
    return ["baselines.evaluate", "--policy", "still:Still", "--env", "my-mine", "--jobs", "1"]


def test_an_own_mine_can_be_chosen_for_training(own):
    code = "from baselines.ppo.settings import compose_settings as c; s = c(['env=my-mine']); print(s.env, s.name)"
    done = own.run(sys.executable, "-c", code)
    assert done.stdout.split() == ["MineXplore/my-mine-v0", "my-mine-beams-mlp-42"], done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("kind", [signal.SIGTERM, signal.SIGKILL])
def test_an_evaluation_that_is_ended_leaves_no_process_behind(own, kind):
    words = ["--policy", "random", "--env", "my-mine", "--episodes", "10", "--jobs", "2"]
    with subprocess.Popen(
        [sys.executable, "-m", "baselines.evaluate", *words], cwd=own.folder, stderr=subprocess.PIPE, text=True
    ) as run:
        children = Path(f"/proc/{run.pid}/task/{run.pid}/children")
        assert eventually(lambda: len(children.read_text().split()) == 3)  # two workers and multiprocessing's tracker
        workers = [Path(f"/proc/{child}") for child in children.read_text().split()]
        run.send_signal(kind)
        assert run.wait(60) == (130 if kind == signal.SIGTERM else -kind)
        assert eventually(lambda: not any(worker.exists() for worker in workers))
        # Python itself prints one where a worker that begins loses its parent.
        assert kind == signal.SIGKILL or "Traceback" not in run.stderr.read()
    assert not (own.folder / "baselines/results/my-mine-v0/random.jsonl").exists()


SLEEPS = """
import time


class Sleeps:
    def __init__(self, count, task, robot):
        pass

    def reset(self, robots, seeds):
        time.sleep(600)
"""
DRIVES = """
from baselines.base.errors import run_command
from baselines.running.parallel import SEEDS_A_PIECE, drive
from baselines.sandbox.confined import Confined
from pieces.work import Where

if __name__ == "__main__":
    seeds = list(range(2 * SEEDS_A_PIECE))
    run_command("drive", lambda: drive("sleeps:Sleeps", "MineXplore/my-mine-v0", seeds, Where(2), Confined()))
"""


@needs_sandbox
@pytest.mark.slow
def test_policies_in_sandboxes_that_are_ended_leave_no_copy_behind(own, tmp_path):
    (own.folder / "sleeps.py").write_text(SLEEPS)
    variables = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen([sys.executable, "-c", DRIVES], cwd=own.folder, env=variables) as run:
        assert eventually(lambda: len(list(tmp_path.rglob("sleeps.py"))) == 2)
        run.send_signal(signal.SIGTERM)
        run.wait(60)
    assert list(tmp_path.glob("policy-*")) == []


@pytest.mark.slow
def test_an_own_mine_gets_a_bound_and_a_tour(own):
    said = python(own, ["baselines.oracle", "--env", "my-mine", "--episodes", "1", "--limit", "5"])
    assert "MineXplore/my-mine-v0: at 600 s no robot can have seen more than" in said
    assert (own.folder / "docs/oracle-my-mine-v0.png").is_file()
    (own.folder / "baselines/results/my-mine-v0/oracle-tour.jsonl").unlink()  # one episode is no result
    python(own, evaluation_of_still(own), ["baselines.leaderboard"])
    assert "share of bound at 600 s" in (own.folder / "LEADERBOARD.md").read_text()
