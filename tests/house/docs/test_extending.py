"""The code of docs/reference/extending.md works as it stands."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import zipfile
from typing import Any

import gymnasium
import numpy as np
import pytest

import minexplore  # noqa: F401  registers the environments
from baselines.explorers import EXPLORERS
from baselines.policies.policy_lookup import make_policy
from minexplore.task import TaskParams
from pipeline.errors import LimitError
from pipeline.metrics.limits import require_limits
from pipeline.params.validation import Limit
from pipeline.proof.validator import MEASURES, Validator
from tests.extensions import PAGE, apply, blocks, changes
from tests.mines import TEE
from tests.project import ROOT

ROWS = changes()
MOST_FILES = 5


def run_blocks(title: str) -> dict[str, Any]:
    """Run the Python blocks of a section of the page, all but those that make an environment, and return its names."""
    names: dict[str, Any] = {"__name__": "extending"}
    for block in blocks(title):
        if "gymnasium.make(" not in block:
            exec(compile(block, title, "exec", dont_inherit=True), names)
    return names


def rows_of_the_page() -> dict[str, str]:
    """Return the rows of the page's table by their first cell."""
    rows = re.findall(r"^\| (.+?) \|(.*)\|$", PAGE.read_text(), flags=re.M)
    return {title: rest for title, rest in rows if title != "to add"}


def test_the_page_has_a_row_for_each_change():
    assert list(rows_of_the_page()) == list(ROWS)


@pytest.mark.parametrize("row", ROWS)
def test_a_row_costs_at_most_five_files_and_names_their_places(row):
    assert len(ROWS[row]) <= MOST_FILES
    places = re.findall(r"`([\w/.]+)`", rows_of_the_page()[row])
    for file in ROWS[row]:
        assert [place for place in places if file == place or file.startswith(place.rstrip("FORMATNE.py"))], file


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """Return a copy of the code in which the changes of all rows are made."""
    folder = tmp_path_factory.mktemp("extended")
    left_out = shutil.ignore_patterns("__pycache__", "results", "worlds", "tests")
    for name in (
        "minesurveys",
        "minexplore",
        "pieces",
        "pipeline",
        "stages",
        "baselines",
        "benchmarks",
        "conf",
        "docs",
        "data",
    ):
        shutil.copytree(ROOT / name, folder / name, ignore=left_out)
    shutil.copy(ROOT / "params.yaml", folder)
    for change in ROWS.values():
        apply(change, folder)
    return folder


@pytest.mark.slow
def test_the_change_of_each_row_passes_its_own_test_in_a_copy_of_the_project(extended):
    tests = [file for change in ROWS.values() for file in change if re.search(r"(^|/)tests/", file)]
    assert len(tests) == len(ROWS)
    command = [sys.executable, "-m", "pytest", "-q", "-c", os.devnull, "--rootdir", ".", *tests]
    env = {**os.environ, "PYTHONPATH": str(extended)}
    done = subprocess.run(command, cwd=extended, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_observation_of_the_page_shows_how_the_mine_dips(tee):
    wrapper = run_blocks("An observation")["WithTilt"]
    env = wrapper(gymnasium.make("MineXplore/World-v0", world=str(tee.bundle)))
    observation, info = env.reset(seed=0)
    assert observation[-2:] == pytest.approx([float(info["pitch_rad"]), float(info["roll_rad"])])
    observation, *_ = env.step(np.array([0.5, 0.0]))
    assert env.observation_space.contains(observation)
    assert np.linalg.norm(observation[-2:]) == pytest.approx(np.radians(5.0), abs=0.02)  # the world dips by 5 deg
    env.close()


def test_the_distribution_of_the_page_adds_its_format_where_it_is_installed(tmp_path):
    (tmp_path / "wkt_surveys.py").write_text(blocks("A survey format")[0])
    (tmp_path / "pyproject.toml").write_text(blocks("A survey format", "toml")[0])
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", "dist"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    (wheel,) = (tmp_path / "dist").glob("*.whl")
    site = tmp_path / "site"
    zipfile.ZipFile(wheel).extractall(site)
    (tmp_path / "mine.wkt").write_text(f"{TEE.wkt}\n")
    (tmp_path / "bad.wkt").write_text("POLYGON ((0 0, 1\n")
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (ROOT, site)))}

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([sys.executable, *words], cwd=tmp_path, env=env, capture_output=True, text=True)

    read = run("-c", "import minesurveys; found = minesurveys.read('mine.wkt'); print(found.unit, *found.shapes)")
    assert read.stdout == f"m {TEE.wkt}\n", read.stderr
    program = "from pathlib import Path; from pipeline.survey.detect import detect_survey as detect\n"
    program += "found = detect(Path('mine.wkt')); print(found.values['kind'], found.width_m); detect(Path('bad.wkt'))"
    detected = run("-c", program)
    kind, width_m = detected.stdout.split()
    assert kind == "vector"
    assert float(width_m) == pytest.approx(2 * TEE.area / TEE.length)
    assert "bad.wkt: not Well-Known Text" in detected.stderr
    bare = subprocess.run(
        [sys.executable, "-c", "import minesurveys; minesurveys.read('mine.wkt')"],
        cwd=tmp_path,
        env={**env, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert "mine.wkt: .wkt is not a supported format" in bare.stderr


def test_the_metric_of_the_page_is_measured_and_held_to_its_limit(tee, config, monkeypatch):
    monkeypatch.setitem(MEASURES, "drive", None)
    run_blocks("A metric with a limit")
    found = Validator(config.validation, tee.bundle, tee.cleaned, tee.raw, tee.survey)
    measured = found.measure("drive")
    assert measured["steepest_grade"] == pytest.approx(np.tan(np.radians(5.0)), abs=1e-3)  # the world dips by 5 deg
    require_limits({"drive": measured}, {"drive.steepest_grade": Limit(max=0.10)})
    with pytest.raises(LimitError, match=r"drive\.steepest_grade = 0\.087"):
        require_limits({"drive": measured}, {"drive.steepest_grade": Limit(max=0.05)})


def test_the_explorer_of_the_page_drives_into_the_mine(tee, monkeypatch):
    monkeypatch.setitem(EXPLORERS, "longest-beam", None)
    run_blocks("An explorer")
    env = gymnasium.make_vec("MineXplore/World-v0", 2, vectorization_mode="vector_entry_point", world=str(tee.bundle))
    policy = make_policy("longest-beam", 2, TaskParams())
    observation, info = env.reset(seed=0)
    start = info["pose_m_rad"][:, :2].copy()
    policy.reset(np.arange(2), np.arange(2))
    for _ in range(150):
        observation, _, _, _, info = env.step(policy.act(observation, info))
    assert np.linalg.norm(info["pose_m_rad"][:, :2] - start, axis=1).min() > 3.0
    env.close()


def test_the_robot_of_the_page_turns_less_than_one_with_wheels(tee):
    tracked = run_blocks("Another robot")["TrackedRobot"]
    turned = {}
    for name, robot in (("tracked", tracked()), ("wheels", tracked(turn_share=1.0))):
        env = gymnasium.make("MineXplore/World-v0", world=str(tee.bundle), robot=robot, task={"tilt": False})
        _, info = env.reset(seed=0)
        yaw = [info["pose_m_rad"][2]]
        for _ in range(20):
            *_, info = env.step(np.array([0.0, 0.3]))
            yaw.append(info["pose_m_rad"][2])
        turned[name] = np.unwrap(yaw)[-1] - yaw[0]
        env.close()
    assert 0.2 < turned["tracked"] < 0.9 * turned["wheels"]
    controls = {share: tracked(turn_share=share).controls(np.array([0.0]), np.array([1.0])) for share in (0.6, 1.0)}
    assert controls[0.6] == pytest.approx(0.6 * controls[1.0])
