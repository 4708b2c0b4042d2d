"""The examples run as a reader runs them, are short, and the notebook holds the code of its script."""

import importlib.util
import json
import os
import re
import subprocess
import sys

import gymnasium
import numpy as np
import pytest

import minexplore
from tests.project import ROOT, Project

EXAMPLES = ROOT / "examples"
needs_world = pytest.mark.skipif(
    not (ROOT / "artifacts/realism/world/world.json").is_file(), reason="the default world is not built: `make all`"
)


def run(name, *words, folder=ROOT):
    # `make setup` puts the checkout on Python's path; here that is the copy.
    variables = {**os.environ, "MUJOCO_GL": "osmesa", "OMP_NUM_THREADS": "1", "PYTHONPATH": str(folder)}
    command = [sys.executable, str(folder / "examples" / name), *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, env=variables)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.name)
def test_an_example_is_shorter_than_60_lines(path):
    assert len(path.read_text().splitlines()) < 60


@needs_world
def test_drive_writes_a_picture(tmp_path):
    done = run("drive.py", "--steps", "5", "--out", str(tmp_path / "view.png"))
    assert done.returncode == 0, done.stderr
    assert "coverage" in done.stdout
    assert (tmp_path / "view.png").read_bytes().startswith(b"\x89PNG")


@needs_world
def test_a_map_is_made_of_a_lidars_scans(tmp_path):
    pytest.importorskip("open3d", reason="open3d is not installed (make setup)")
    done = run("map_from_lidar.py", "--steps", "11", "--out", str(tmp_path / "map.ply"))
    assert done.returncode == 0, done.stderr
    assert "2 scans" in done.stdout
    assert (tmp_path / "map.ply").read_bytes().startswith(b"ply")


@needs_world
def test_a_bundle_is_read_without_the_package():
    done = run("read_bundle.py")
    assert done.returncode == 0, done.stderr
    assert "m north of the start" in done.stdout
    assert "minexplore" not in (EXAMPLES / "read_bundle.py").read_text()


def test_a_survey_is_read_without_the_pipeline(tmp_path):
    done = run("read_survey.py")
    assert done.returncode == 0, done.stderr
    assert "856 stations" in done.stdout
    assert "coordinate system epsg:27700" in done.stdout
    page = (ROOT / "minesurveys/README.md").read_text()
    (block,) = re.findall(r"^```python\n(.*?)^```", page, flags=re.M | re.S)
    listing = "import sys; print(*{name.partition('.')[0] for name in sys.modules})"
    done = subprocess.run([sys.executable, "-c", block + listing], cwd=ROOT, capture_output=True, text=True)
    printed, loaded = done.stdout.splitlines()
    assert printed == "856 stations epsg:27700", done.stderr
    loaded = loaded.split()
    assert "minesurveys" in loaded
    assert not {"pipeline", "stages", "minexplore", "mujoco", "gymnasium", "hydra"} & set(loaded)


def test_a_bundle_that_is_one_volume_is_read_and_a_robot_placed_in_it(ramp):
    done = run("read_bundle.py", str(ramp))
    assert done.returncode == 0, done.stderr
    assert "volume.npz: vertices" in done.stdout
    assert re.search(r"rock is 2\.\d\d m north of the start", done.stdout)
    done = run("place_robot.py", "--world", str(ramp), "--seconds", "1")
    assert done.returncode == 0, done.stderr
    assert "robot/torso after 1.0 s" in done.stdout


@needs_world
def test_a_robot_of_gymnasium_is_placed_and_stepped():
    done = run("place_robot.py", "--seconds", "1")
    assert done.returncode == 0, done.stderr
    assert "robot/torso after 1.0 s" in done.stdout
    assert "timestep 0.01 s (environments: 0.005 s)" in done.stderr


@needs_world
@pytest.mark.slow
def test_a_custom_explorer_is_evaluated_and_its_results_are_written(tmp_path):
    done = run("custom_explorer.py", "--episodes", "1", "--out", str(tmp_path / "own.jsonl"))
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "own.jsonl").read_text().splitlines()[0])["policy"] == "custom_explorer.LongestBeam"


@pytest.mark.skipif(importlib.util.find_spec("stable_baselines3") is not None, reason="Stable-Baselines3 is installed")
def test_training_says_in_one_line_how_to_install_what_is_missing():
    done = run("train_sb3.py", "--steps", "50")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "pip install 'stable-baselines3>=2.6'" in done.stderr


@needs_world
def test_training_by_stable_baselines3_saves_a_policy(tmp_path):
    pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 is not installed (extra sb3)")
    done = run("train_sb3.py", "--steps", "256", "--robots", "2", "--out", str(tmp_path / "policy"))
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "policy.zip").is_file()


@needs_world
def test_the_environment_that_training_uses_resets_a_robot_in_the_step_that_ends_its_episode():
    many = gymnasium.make_vec(
        "MineXplore/ChileanMineEntrance-v0",
        num_envs=2,
        vectorization_mode="vector_entry_point",
        autoreset_mode=gymnasium.vector.AutoresetMode.SAME_STEP,
        max_episode_steps=3,
    )
    many.reset(seed=0)
    for _ in range(3):
        observation, _, _, truncated, info = many.step(np.zeros((2, 2), dtype=np.float32))
    assert truncated.all()
    assert observation.shape == np.stack(info["final_obs"]).shape
    many.close()


@pytest.mark.slow
def test_a_mine_from_a_small_geojson_is_built_and_driven_in(tmp_path):
    project = Project(tmp_path, tiny=False)
    done = run("own_mine.py", "--steps", "20", folder=project.folder)
    assert done.returncode == 0, done.stderr
    assert "after 20 steps" in done.stdout


def parts_of(script):
    """Return the parts of a script, each from a `# %%` remark on."""
    parts = re.split(r"^(?=# %% )", script.read_text(), flags=re.M)
    return [part.strip().replace("# %% ", "# ") for part in parts]


def test_the_notebook_installs_the_wheel_and_then_holds_the_parts_of_its_script():
    notebook = json.loads((EXAMPLES / "drive.ipynb").read_text())
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert f"pip install ./minexplore-{minexplore.__version__}-" in cells[0]
    assert cells[1:] == parts_of(EXAMPLES / "drive.py")
    assert not any(cell.get("outputs") for cell in notebook["cells"])


@pytest.mark.slow
def test_the_notebook_has_the_format_of_its_version():
    import nbformat

    nbformat.validate(nbformat.read(EXAMPLES / "drive.ipynb", as_version=4))
