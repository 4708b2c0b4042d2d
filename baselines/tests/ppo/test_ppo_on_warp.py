"""Training on the environment's device, which the extra `gpu` brings: `python -m benchmarks test-gpu` runs these."""

import json
import sys

import numpy as np
import pytest

import minexplore.extra.warp
from baselines.base.errors import BaselineError
from baselines.policies.learned import LearnedPolicy, trained_in
from baselines.ppo import train_gpu
from baselines.ppo.settings import compose_settings
from minexplore.task import TaskParams
from tests.project import ROOT

SMALL = ["robots=4", "ppo.fragment=4", "ppo.minibatch=8", "ppo.epochs=1", "steps=32", "checkpoint_every=1"]


@pytest.fixture
def settings(tee_id, monkeypatch):
    """Return the settings of a run of a few seconds."""
    monkeypatch.chdir(ROOT)
    return lambda *overrides: compose_settings([*SMALL, *overrides]).model_copy(update={"env": tee_id})


def start(settings, run, history):
    return train_gpu.start_on_device("cpu", settings, run, history)


def test_a_run_is_trained_and_resumed_and_its_policy_is_what_was_trained(settings, tmp_path):
    pytest.importorskip("mujoco_warp", reason="MuJoCo Warp comes with `make setup-gpu`")
    torch = pytest.importorskip("torch", reason="torch comes with `make setup-gpu`")
    from baselines.ppo.device_algorithm import DeviceAlgorithm

    kept = []
    folder = tmp_path / "run"
    assert train_gpu.train(settings(), folder, start)["stop"] == "steps"
    reached = train_gpu.train(settings("steps=48"), folder, lambda *given: kept.append(start(*given)) or kept[0])
    lines = [json.loads(line) for line in (folder / "progress.jsonl").read_text().splitlines()]
    assert [line["iteration"] for line in lines] == [1, 2, 3]
    assert reached["steps"] == lines[-1]["steps"] == 48
    algorithm: DeviceAlgorithm = kept[0]
    assert algorithm.training_iteration == 3
    policy = LearnedPolicy(folder / "policy.safetensors", 4, TaskParams())
    assert trained_in(folder / "policy.safetensors") == settings().env
    observation = np.random.default_rng(0).random((4, 19)).astype(np.float32)
    with torch.no_grad():
        mean = algorithm.ppo.get_policy()(algorithm._group(torch.tensor(observation))).numpy()
    np.testing.assert_allclose(policy.act(observation, {}), np.clip(mean, -1, 1), atol=1e-5)


def test_the_figures_of_episodes_are_those_of_their_rewards(tee):
    pytest.importorskip("mujoco_warp", reason="MuJoCo Warp comes with `make setup-gpu`")
    torch = pytest.importorskip("torch", reason="torch comes with `make setup-gpu`")
    from baselines.ppo.device_env import DeviceTrainingEnv
    from minexplore.backends import make_vector_env

    task = {"max_steps": 5, "physics_s": 0.05}
    made = {"device": "cpu", "world": tee.bundle, "task": task, "autoreset_mode": "SAME_STEP"}
    env = DeviceTrainingEnv(make_vector_env(3, "warp", **made), 0.5, 0.0, 12, 0)
    total, returns, lengths = torch.zeros(3), [], []
    steps = torch.zeros(3)
    for _ in range(12):
        _, reward, truncated = env.step(torch.tensor([[1.0, 0.2]] * 3))
        total += reward / 0.5
        steps += 1
        returns += total[truncated].tolist()
        lengths += steps[truncated].tolist()
        total[truncated], steps[truncated] = 0.0, 0.0
    found = env.take_episodes()
    assert len(returns) >= 6
    assert max(lengths) == 5
    np.testing.assert_allclose(found["return"], returns, atol=1e-4)
    assert found["steps"] == lengths
    assert min(found["coverage"]) > 0


def test_a_map_or_an_lstm_is_refused_on_a_device(settings):
    pytest.importorskip("mujoco_warp", reason="MuJoCo Warp comes with `make setup-gpu`")
    pytest.importorskip("rsl_rl", reason="rsl-rl comes with `make setup-gpu`")
    from baselines.ppo.device_algorithm import DeviceAlgorithm

    with pytest.raises(BaselineError, match="observation = map, model = mlp: on a device want beams and mlp"):
        DeviceAlgorithm(settings("observation=map"), 0, "cpu")


def test_training_without_the_extra_says_what_to_install(tmp_path, monkeypatch, tee_id, capsys):
    monkeypatch.setattr(minexplore.extra.warp, "find_spec", lambda name: None)
    monkeypatch.setattr(sys, "argv", ["train_gpu", f"env={tee_id.partition('/')[2].removesuffix('-v0')}"])
    monkeypatch.setattr(train_gpu, "TRAINED", tmp_path)
    monkeypatch.chdir(ROOT)
    assert train_gpu.run_command("train-gpu", train_gpu.main) == 2
    assert "make setup-gpu" in capsys.readouterr().err
