import re
import subprocess
import sys

import pytest

from minexplore import WORLDS
from minexplore.page import page
from tests.forked import run_forked
from tests.mines import BuiltMine
from tests.project import ROOT


def run(*arguments):
    return run_forked("minexplore", arguments, ROOT)


def run_anew(*arguments):
    command = [sys.executable, "-m", "minexplore", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)


def test_the_list_names_every_environment():
    done = run_anew("list")
    assert done.returncode == 0
    assert all(env_id in done.stdout for env_id in WORLDS)


def test_the_committed_page_is_the_docstrings():
    assert (ROOT / "docs" / "reference" / "environment.md").read_text() == page()
    headings = "Action Space,Observation Space,Rewards,Starting State,Episode End,Arguments,Physics,Version History"
    for heading in headings.split(","):
        assert f"## {heading}" in page()


def test_it_times_a_world(tee: BuiltMine):
    done = run("time", "MineXplore/World-v0", "--world", str(tee.bundle), "--robots", "4", "--steps", "5")
    assert done.returncode == 0, done.stderr
    assert "control steps/s: 4 robots, 1 threads" in done.stdout


def test_a_policy_plays_and_is_recorded(tee: BuiltMine, tmp_path):
    options = ("--world", str(tee.bundle), "--policy", "ahead", "--steps", "3", "--video", str(tmp_path / "videos"))
    done = run_anew("play", "MineXplore/World-v0", *options)
    assert done.returncode == 0, done.stderr
    assert "coverage" in done.stdout
    assert "Overwriting" not in done.stdout + done.stderr  # as Gymnasium warns of a folder that is there
    assert list((tmp_path / "videos").glob("*.mp4"))


@pytest.mark.parametrize("name", ["World", "GoTo", "MineXplore/GoTo-v0"])
def test_a_short_name_is_the_id(tee: BuiltMine, name):
    done = run("time", name, "--world", str(tee.bundle), "--robots", "2", "--steps", "2")
    assert done.returncode == 0, done.stderr


def test_a_drive_to_a_goal_is_played_and_says_how_far_it_is(tee: BuiltMine, tmp_path, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    options = ("--world", str(tee.bundle), "--policy", "ahead", "--steps", "3", "--video", str(tmp_path))
    done = run_anew("play", "GoTo", *options)
    assert done.returncode == 0, done.stderr
    assert re.search(r"\d+\.\d m to the goal$", done.stdout.strip())
    assert "frames/s" in done.stdout
    assert "MUJOCO_GL=egl before the command is faster" in done.stdout


def test_a_folder_of_videos_that_cannot_be_made_is_named(tee: BuiltMine):
    options = ("--world", str(tee.bundle), "--policy", "ahead", "--steps", "2", "--video", "README.md/videos")
    done = run_anew("play", "World", *options)
    assert done.returncode == 2
    assert "play: video = 'README.md/videos': no folder that can be written (Not a directory)" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("time", "MineXplore/World-v0"), "no world: give world="),
        (("time", "MineXplore/World-v0", "--world", "nowhere"), "no such folder"),
        (("time", "MineXplore/Moon-v0"), "MineXplore/Moon-v0: no environment has this id"),
        (("time", "MineXplore/World-v0", "--world", "tests"), "not a world bundle"),
        (("play", "GoTo-Family"), "GoTo-Family draws a mine an episode; name one that is built"),
        (("time", "World", "--steps", "0"), "time: steps = 0: want 1 or more"),
        (("play", "World", "--steps", "-3"), "play: steps = -3: want 1 or more"),
        (("play", "World", "--video", "videos"), "policy = 'keyboard': --video has no screen to take keys from"),
        (("time", "ChileanMine", "--world", "tests"), "MineXplore/ChileanMine-v0 has its own; want MineXplore/World"),
    ],
)
def test_wrong_input_gets_one_message_and_code_two(arguments, words):
    done = run(*arguments)
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr
