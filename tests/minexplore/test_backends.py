"""What a user without the extra `gpu`, or without a GPU, is told; these tests need neither."""

import importlib.util
import subprocess
import sys

import pytest

import minexplore.extra.warp
from benchmarks.speed import gpu_parity, time_gpu
from minexplore.backends import make_vector_env
from minexplore.envs.vector import MineVectorEnv
from tests.mines import BuiltMine
from tests.project import ROOT


@pytest.fixture
def bare(monkeypatch):
    """Hide Warp and torch."""
    found = importlib.util.find_spec
    hidden = ("warp", "torch")
    monkeypatch.setattr(minexplore.extra.warp, "find_spec", lambda name: None if name in hidden else found(name))


def test_without_a_backend_the_cpus_environment_is_made(tee: BuiltMine):
    env = make_vector_env(2, world=tee.bundle)
    assert type(env) is MineVectorEnv
    env.close()


def test_an_unknown_backend_is_refused_with_the_known_ones(tee: BuiltMine):
    with pytest.raises(ValueError, match="backend = 'mjx': valid choices are mujoco, warp"):
        make_vector_env(2, "mjx", world=tee.bundle)


def test_one_line_says_what_to_install(bare, tee: BuiltMine):
    with pytest.raises(ImportError, match=r"needs warp-lang, .*torch: make setup-gpu") as error:
        make_vector_env(2, "warp", world=tee.bundle)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("command", [time_gpu.main, gpu_parity.main])
def test_measurements_say_that_there_is_no_device_and_end_with_code_3(bare, capsys, monkeypatch, command):
    monkeypatch.setattr(sys, "argv", ["command"])
    assert command() == 3
    said = capsys.readouterr().err
    assert "make setup-gpu" in said
    assert said.count("\n") == 1


def test_the_default_set_up_needs_nothing_of_the_extra():
    code = (
        "import sys, minexplore.backends, minexplore.extra.warp; sys.exit(bool({'warp', 'torch'} & sys.modules.keys()))"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0
    lock = (ROOT / "requirements" / "dev.txt").read_text()
    assert not [name for name in ("warp-lang==", "mujoco-warp==", "rsl-rl-lib==") if name in lock]
