"""Worlds of one's own, in a copy of the package beside an `artifacts` folder as a source checkout has it."""

import json
import shutil
import subprocess
import sys

import pytest

from minexplore.unfinished import command_to_end
from tests.mines import BuiltMine, end_build
from tests.project import ROOT

MINE = "MineXplore/my-mine-v0"


@pytest.fixture(scope="module")
def checkout(tee: BuiltMine, tmp_path_factory):
    folder = tmp_path_factory.mktemp("checkout")
    shutil.copytree(ROOT / "minexplore", folder / "minexplore", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(tee.bundle, folder / "artifacts" / "worlds" / "my-mine" / "realism" / "world")
    end_build(folder / "artifacts" / "worlds" / "my-mine")
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


def test_an_own_world_is_played_by_its_id(checkout, tmp_path):
    pytest.importorskip("moviepy", reason="moviepy is not installed (make setup)")
    done = run(checkout, "play", MINE, "--policy", "ahead", "--steps", "3", "--video", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.glob("*.mp4"))


def test_a_mine_of_a_family_that_was_built_is_timed_by_its_id_and_the_family_itself_is_not(checkout, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(checkout, folder)
    mines = folder / "artifacts" / "families" / "light" / "test"
    shutil.copytree(folder / "artifacts/worlds/my-mine", mines / "0003")
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
    assert done.returncode == 0, done.stderr
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


NEW = "python -m pipeline new my-mine --from 'a plan.png' preset=light"
PARAMS = f"# Composed from conf/; do not edit.\n# Continue with: {NEW}\nsurvey: {{}}\n"
MAKE = f"""
import gymnasium, minexplore
ways = lambda: gymnasium.make({MINE!r}), lambda: gymnasium.make_vec({MINE!r}, 2), lambda: minexplore.load("my-mine")
for make in ways:
    try:
        make()
    except minexplore.world.BundleError as error:
        print(error)
"""


def never_validated(root):
    shutil.rmtree(root / "validation")


def built_again(root):
    record = root / "realism" / "world" / "world.json"
    record.write_bytes(record.read_bytes() + b" ")


def cut_short(root):
    manifest = root / "validation" / "manifest.json"
    manifest.write_bytes(manifest.read_bytes()[:-20])


def of_another_stage(root):
    manifest = root / "validation" / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"validation"', '"realism"'))


@pytest.fixture
def root(checkout, tmp_path):
    """Return a copy of an own world with its stages, in a folder of artifacts."""
    root = tmp_path / "artifacts" / "worlds" / "my-mine"
    shutil.copytree(checkout / "artifacts" / "worlds" / "my-mine", root)
    return root


def end_of(root):
    """Return the command that ends a world, as a checkout with its artifacts says."""
    return command_to_end(root / "realism" / "world", root.parents[1])


@pytest.mark.parametrize("state", [never_validated, built_again, cut_short, of_another_stage])
def test_a_world_whose_last_stage_has_not_ended_is_unfinished(root, state):
    (root / "params.yaml").write_text(PARAMS)
    assert end_of(root) is None
    state(root)
    assert end_of(root) == NEW


@pytest.mark.parametrize("params", ["", "# Continue with: \x1b[2J\n", "# Continue with: " + "x" * 600, "\udcff"])
def test_an_unfinished_world_of_an_older_build_names_the_usual_command(root, params):
    (root / "params.yaml").write_bytes(params.encode(errors="surrogateescape"))
    never_validated(root)
    assert end_of(root) == "python -m pipeline new my-mine --from FILE"


def test_whatever_makes_an_unfinished_world_names_the_command_that_ends_it(checkout, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(checkout, folder)
    root = folder / "artifacts" / "worlds" / "my-mine"
    (root / "params.yaml").write_text(PARAMS)
    never_validated(root)
    done = run(folder, "list")
    (line,) = [line for line in done.stdout.splitlines() if line.startswith(MINE)]
    assert "unfinished" in line
    assert f"`{NEW}` ends it" in line
    made = subprocess.run([sys.executable, "-c", MAKE], capture_output=True, text=True, cwd=folder, check=False)
    refused = f"unfinished: its last stage has not ended; `{NEW}` ends it"
    assert [refused in line for line in made.stdout.splitlines()] == [True] * 3, made.stderr
    played = run(folder, "time", MINE)
    assert played.returncode == 2
    assert f"`{NEW}` ends it" in played.stderr
    assert played.stderr.count("\n") == 1
