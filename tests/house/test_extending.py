"""The code of docs/reference/extending.md works as it stands."""

from __future__ import annotations

import re
from typing import Any

import gymnasium
import numpy as np
import pytest
import shapely

import minexplore  # noqa: F401  registers the environments
from baselines.explorers import EXPLORERS
from baselines.policies.found import make_policy
from minexplore.task import TaskParams
from pipeline.errors import InputError, LimitError
from pipeline.metrics.limits import require_limits
from pipeline.params.validation import Limit
from pipeline.proof.validator import MEASURES, Validator
from pipeline.survey.detect import detect_survey
from pipeline.survey.formats import SHAPE_READERS
from tests.mines import TEE
from tests.project import ROOT


def run_blocks(title: str) -> dict[str, Any]:
    """Run the Python blocks of a section of the page, all but those that make an environment, and return its names."""
    page = (ROOT / "docs" / "reference" / "extending.md").read_text()
    section = page.split(f"\n## {title}\n")[1].split("\n## ")[0]
    names: dict[str, Any] = {"__name__": "extending"}
    for block in re.findall(r"^```python\n(.*?)^```", section, flags=re.M | re.S):
        if "gymnasium.make(" not in block:
            exec(compile(block, title, "exec", dont_inherit=True), names)
    return names


def test_the_survey_format_of_the_page_is_detected_and_refuses_other_text(tmp_path, monkeypatch):
    monkeypatch.setitem(SHAPE_READERS, ".wkt", None)
    run_blocks("A survey format")
    (tmp_path / "mine.wkt").write_text(f"{TEE.wkt}\n")
    detected = detect_survey(tmp_path / "mine.wkt", {})
    assert detected.values["kind"] == "vector"
    assert detected.width_m == pytest.approx(2 * TEE.area / TEE.length)
    assert shapely.equals(SHAPE_READERS[".wkt"](tmp_path / "mine.wkt", None).shapes[0], TEE)
    (tmp_path / "bad.wkt").write_text("POLYGON ((0 0, 1\n")
    with pytest.raises(InputError, match=r"bad\.wkt: not Well-Known Text"):
        detect_survey(tmp_path / "bad.wkt", {})


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
