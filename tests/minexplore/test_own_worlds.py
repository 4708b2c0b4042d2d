"""Worlds of one's own, in a copy of the package beside an `artifacts` folder as a source checkout has it."""

import json
import shutil
import subprocess
import sys

import pytest

from tests.mines import BuiltMine
from tests.project import ROOT

MINE = "MineXplore/my-mine-v0"


@pytest.fixture(scope="module")
def checkout(tee: BuiltMine, tmp_path_factory):
    folder = tmp_path_factory.mktemp("checkout")
    shutil.copytree(ROOT / "minexplore", folder / "minexplore", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(tee.bundle, folder / "artifacts" / "worlds" / "my-mine" / "realism" / "world")
    return folder


def run(folder, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "minexplore", *arguments], capture_output=True, text=True, cwd=folder, check=False
    )


def test_an_own_world_is_listed(checkout):
    done = run(checkout, "list")
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith(MINE)]
    assert "m2, 3 drifts" in line


def test_the_spec_of_an_own_world_can_be_written_as_json(checkout):
    code = f"import gymnasium, minexplore; print(gymnasium.spec({MINE!r}).to_json())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=checkout, check=False)
    assert done.returncode == 0, done.stderr
    world = checkout / "artifacts" / "worlds" / "my-mine" / "realism" / "world"
    assert json.loads(done.stdout)["kwargs"] == {"world": str(world)}


def test_an_own_world_is_timed_by_its_id(checkout):
    done = run(checkout, "time", MINE, "--robots", "2", "--steps", "2")
    assert done.returncode == 0, done.stderr
    assert "control steps/s: 2 robots" in done.stdout


def test_an_own_world_is_played_by_its_id(checkout, tmp_path):
    pytest.importorskip("moviepy")
    done = run(checkout, "play", MINE, "--policy", "ahead", "--steps", "3", "--video", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.glob("*.mp4"))


def test_a_mine_of_a_family_that_was_built_is_timed_by_its_id_and_the_family_itself_is_not(checkout, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(checkout, folder)
    mines = folder / "artifacts" / "families" / "light" / "test"
    shutil.copytree(folder / "artifacts/worlds/my-mine/realism", mines / "0003" / "realism")
    done = run(folder, "time", "MineXplore/Family-test-0003-v0", "--robots", "2", "--steps", "2")
    assert done.returncode == 0, done.stderr
    refused = run(folder, "time", "MineXplore/Family-v0")
    assert refused.returncode == 2
    assert "MineXplore/Family-v0 draws a mine an episode; name one that is built" in refused.stderr


def test_an_id_that_is_not_there_is_refused_with_all_that_are(checkout):
    done = run(checkout, "time", "MineXplore/Moon-v0")
    assert done.returncode == 2
    assert "MineXplore/Moon-v0: no environment has this id; there are" in done.stderr
    assert MINE in done.stderr
    assert "MineXplore/ChileanMine-v0" in done.stderr


def test_an_own_world_that_was_changed_is_named_and_hides_no_other(checkout, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(checkout, folder)
    (folder / "artifacts" / "worlds" / "my-mine" / "realism" / "world" / "mine.xml").write_text("<mujoco/>")
    done = run(folder, "list")
    assert done.returncode == 0
    assert "mine.xml: sha256" in done.stdout
    assert "MineXplore/World-v0" in done.stdout
    played = run(folder, "time", MINE)
    assert played.returncode == 2
    assert "mine.xml: sha256" in played.stderr
    assert "Traceback" not in played.stderr


def test_the_page_names_the_built_in_environments_only(checkout):
    done = run(checkout, "page")
    assert MINE not in done.stdout
    assert "MineXplore/World-v0" in done.stdout
