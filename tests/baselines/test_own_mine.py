"""A user's own mine, registered from artifacts/worlds, in every command of the benchmark."""

import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.project import Project


@pytest.fixture(scope="module")
def own(tee, tmp_path_factory):
    """Return a copy of the project with the T-junction as a mine of the user's own."""
    project = Project(tmp_path_factory.mktemp("own") / "mine", tiny=False)
    shutil.copytree(tee.bundle, project.folder / "artifacts/worlds/my-mine/realism/world")
    shutil.rmtree(project.folder / "baselines/results")
    return project


@pytest.fixture
def own_short(own, tmp_path):
    """Return a copy of the project with the own mine, in which an episode has 600 steps instead of 6000."""
    project = own.copy(tmp_path / "mine")
    task = project.folder / "minexplore/task.py"
    text = task.read_text()
    assert "max_steps: int = 6000" in text
    task.write_text(text.replace("max_steps: int = 6000", "max_steps: int = 600"))
    return project


def python(project, *words):
    done = project.run(sys.executable, "-m", *words)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_an_own_mine_is_evaluated_scored_and_listed(own_short):
    own = own_short
    python(own, "baselines.evaluate", "--policy", "reactive", "--env", "my-mine")
    results = own.folder / "baselines/results/my-mine-v0/reactive.jsonl"
    assert "reactive in MineXplore/my-mine-v0, 20 seeds" in python(own, "baselines.score", str(results), "--rerun", "1")
    python(own, "baselines.leaderboard")
    page = (own.folder / "LEADERBOARD.md").read_text()
    assert "## MineXplore/my-mine-v0" in page
    assert "| reactive | as stated | 20 |" in page


def test_an_own_mine_can_be_chosen_for_training(own):
    code = "from baselines.ppo.settings import compose_settings as c; s = c(['env=my-mine']); print(s.env, s.name)"
    done = own.run(sys.executable, "-c", code)
    assert done.stdout.split() == ["MineXplore/my-mine-v0", "my-mine-beams-mlp-42"], done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("kind", [signal.SIGTERM, signal.SIGKILL])
def test_an_evaluation_that_is_ended_leaves_no_process_behind(own, kind):
    words = ["--policy", "random", "--env", "my-mine", "--episodes", "2", "--jobs", "2"]
    with subprocess.Popen(
        [sys.executable, "-m", "baselines.evaluate", *words], cwd=own.folder, stderr=subprocess.PIPE, text=True
    ) as run:
        children = Path(f"/proc/{run.pid}/task/{run.pid}/children")
        assert eventually(lambda: len(children.read_text().split()) == 3)  # two workers and multiprocessing's tracker
        workers = [Path(f"/proc/{child}") for child in children.read_text().split()]
        run.send_signal(kind)
        assert run.wait(30) == (130 if kind == signal.SIGTERM else -kind)
        assert eventually(lambda: not any(worker.exists() for worker in workers))
        assert "Traceback" not in run.stderr.read()
    assert not (own.folder / "baselines/results/my-mine-v0/random.jsonl").exists()


def eventually(holds, within_s=120):
    """Return whether a condition comes to hold within a time."""
    end = time.monotonic() + within_s
    while not holds() and time.monotonic() < end:
        time.sleep(0.2)
    return holds()


@pytest.mark.slow
def test_an_own_mine_gets_a_bound_and_a_tour(own):
    said = python(own, "baselines.oracle", "--env", "my-mine", "--limit", "5")
    assert "MineXplore/my-mine-v0: at 600 s no robot can have seen more than" in said
    assert (own.folder / "docs/oracle-my-mine-v0.png").is_file()
    python(own, "baselines.score", str(own.folder / "baselines/results/my-mine-v0/oracle-tour.jsonl"))
    python(own, "baselines.leaderboard")
    assert "share of bound at 600 s" in (own.folder / "LEADERBOARD.md").read_text()
