"""Data sets of explorers' episodes: written, read back, described, refused."""

import importlib.util
import os
import subprocess
import sys

import gymnasium
import numpy as np
import pytest

from baselines.base.errors import BaselineError
from baselines.dataset import EXPLORERS, write_all
from tests.composed import compose
from tests.mines import STRAIGHT, TEE, BuiltMine
from tests.project import ROOT

has_minari = importlib.util.find_spec("minari") is not None


@pytest.fixture(scope="module")
def families(tmp_path_factory):
    """Return a folder with the first two light worlds of the training split."""
    root = tmp_path_factory.mktemp("families")
    config = compose(["preset=light"])
    for number, polygon in enumerate((STRAIGHT, TEE)):
        BuiltMine(polygon, config, root / f"light/train/{number:04d}/realism/world")
    return root


@pytest.mark.skipif(not has_minari, reason="minari is not installed: the extra `data`")
def test_three_explorers_in_two_mines_are_read_back_and_described(families, tmp_path, monkeypatch):
    import minari

    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    card = write_all(tmp_path, EXPLORERS, "train", 2, 30, families).read_text()
    for explorer in EXPLORERS:
        data = minari.load_dataset(f"minexplore/{explorer}-v0")
        assert (data.total_episodes, data.total_steps) == (2, 60)
        env = data.recover_environment()
        for number, episode in enumerate(data.iterate_episodes()):
            assert episode.observations.shape == (31, 19)
            observation, _ = env.reset(seed=number, options={"mine": f"train-{number:04d}"})
            np.testing.assert_array_equal(observation, episode.observations[0])
            for action, want in zip(episode.actions, episode.observations[1:], strict=True):
                np.testing.assert_array_equal(env.step(action)[0], want)
        assert f"`minexplore/{explorer}-v0` | 2 | 60 |" in card
    assert "- train-0001 `" in card
    assert sum(path.stat().st_size for path in tmp_path.rglob("*") if path.is_file()) < 1e6
    with pytest.raises(BaselineError, match=r"nearest-frontier-v0: is there; remove it"):
        write_all(tmp_path, EXPLORERS, "train", 2, 30, families)
    words = ["--data", str(tmp_path), "--world", str(families / "light/train/0000/realism/world"), "--steps", "20"]
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples/offline_data.py"), *words],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, done.stderr
    assert "2 episodes, 60 steps" in done.stdout
    assert gymnasium.spec("MineXplore/Family-v0").max_episode_steps == 6000


@pytest.mark.skipif(has_minari, reason="minari is installed")
def test_without_minari_one_line_says_what_to_install():
    for words in (["-m", "baselines.dataset"], ["examples/offline_data.py"]):
        done = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True)
        assert done.returncode in (1, 2)
        assert len(done.stderr.splitlines()) == 1
        assert "minari is not installed" in done.stderr


@pytest.mark.parametrize("words", [["--mines", "0"], ["--mines", "1001"], ["--steps", "0"]])
def test_impossible_numbers_are_refused_in_one_line(words):
    done = subprocess.run([sys.executable, "-m", "baselines.dataset", *words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2
    assert "want 1 to 1000, 1 to 100,000" in done.stderr
