"""Training by Ray and torch, which the extra `baselines` brings: `python -m benchmarks test-train` runs these."""

import json
import re
import shutil
import signal
import subprocess
import sys
import time

import gymnasium
import numpy as np
import pytest

import minexplore
from baselines.base.errors import BaselineError
from baselines.policies.learned import LearnedPolicy
from baselines.ppo import curves
from baselines.ppo.history import History
from baselines.ppo.run_folder import RunFolder
from baselines.ppo.settings import TrainSettings, compose_settings
from baselines.ppo.training_env import TrainingEnv, make_training_env
from minexplore.envs.vector import MineVectorEnv
from minexplore.splits import mine_name
from minexplore.task import TaskParams
from tests.mines import end_build
from tests.project import ROOT, Project


@pytest.fixture
def settings(tee_id, monkeypatch):
    """Return the settings of a run of a few seconds."""
    monkeypatch.chdir(ROOT)
    small = ["robots=4", "ppo.fragment=32", "ppo.minibatch=64", "ppo.epochs=2", "steps=512", "checkpoint_every=2"]

    def with_(*overrides):
        return compose_settings([*small, *overrides]).model_copy(update={"env": tee_id})

    return with_


def read(folder):
    return [json.loads(line) for line in (folder / "progress.jsonl").read_text().splitlines()]


def test_the_training_environment_tells_each_episode_once_and_unscaled(tee):
    env = TrainingEnv(MineVectorEnv(3, tee.bundle, task={"max_steps": 40}), "beams", 0.5, 0.1, 0)
    env.reset(seed=0)
    twin = MineVectorEnv(3, tee.bundle, task={"max_steps": 40})
    _, before = twin.reset(seed=0)
    twin.robots.steps[:] = env.unwrapped.robots.steps
    seen, total, ended = before["cells_seen"].copy(), np.zeros(3), 0
    for _ in range(90):
        action = np.tile([1.0, 0.3], (3, 1))
        _, reward, _, truncated, last = env.step(action)
        _, plain, _, over, info = twin.step(action)
        new = info["cells_seen"] - seen
        begun = new < 0
        np.testing.assert_allclose(reward[~begun], (0.5 * plain + 0.1 * new)[~begun])
        total = np.where(begun, 0.0, total + plain)
        seen = info["cells_seen"].copy()
        np.testing.assert_array_equal(truncated, over)
        if truncated.any():
            ended += truncated.sum()
            np.testing.assert_allclose(last["return"][truncated], total[truncated])
            np.testing.assert_allclose(last["coverage"][truncated], info["coverage"][truncated])
        else:
            assert last == {}
    assert ended >= 6


def test_robots_in_several_mines_train_as_in_each_mine_alone(tee, monkeypatch):
    ids = [f"MineXplore/Family-{mine_name('train', number)}-v0" for number in range(2)]
    kwargs = {"world": str(tee.bundle), "task": {"max_steps": 40}}
    monkeypatch.setattr(minexplore, "FAMILY_MINES", dict.fromkeys(ids, kwargs))
    built = {env_id: gymnasium.registry.pop(env_id) for env_id in ids if env_id in gymnasium.registry}
    for env_id in ids:
        gymnasium.register(
            env_id,
            "minexplore.envs.env:MineEnv",
            vector_entry_point="minexplore.envs.vector:MineVectorEnv",
            kwargs=kwargs,
        )
    context = {
        "env": minexplore.FAMILY,
        "mines": 2,
        "observation": "map",
        "reward_scale": 1.0,
        "cell_bonus": 0.0,
        "seed": 0,
    }
    try:
        env = make_training_env(context | {"num_envs": 4})
        observation, _ = env.reset(seed=5)
        alone = [MineVectorEnv(2, tee.bundle, task={"max_steps": 40}) for _ in ids]
        plain = [mine.reset(seed=5 + 2 * number)[0] for number, mine in enumerate(alone)]
        assert observation.shape == env.observation_space.shape
        np.testing.assert_array_equal(observation[:, :19], np.concatenate(plain))
        action = np.tile([1.0, 0.3], (4, 1))
        for mine, part in zip(alone, (slice(0, 2), slice(2, 4)), strict=True):
            mine.robots.steps[:] = np.concatenate([m.robots.steps for m in env.unwrapped.mines])[part]
        for _ in range(60):
            found, reward, _, truncated, last = env.step(action)
            parts = [mine.step(action[:2]) for mine in alone]
            np.testing.assert_array_equal(found[:, :19], np.concatenate([part[0] for part in parts]))
            np.testing.assert_array_equal(reward, np.concatenate([part[1] for part in parts]))
            np.testing.assert_array_equal(truncated, np.concatenate([part[3] for part in parts]))
            assert ("coverage" in last) == truncated.any()
        env.close()
        with pytest.raises(BaselineError, match="robots = 3, mines = 2: want as many robots in each mine"):
            make_training_env(context | {"num_envs": 3})
        with pytest.raises(BaselineError, match=r"train-0002-v0: not built"):
            make_training_env(context | {"mines": 3})
    finally:
        for env_id in ids:
            del gymnasium.registry[env_id]
        gymnasium.registry.update(built)


@pytest.mark.parametrize(
    ("coverage", "steps", "count"),
    [([0.1, 0.3], [5, 7], 2), (0.2, 6.0, 1), (float("nan"), float("nan"), 0), ([], [], 0)],
)
def test_every_episode_that_ended_is_logged_however_many_they_are(coverage, steps, count):
    history = History(compose_settings([]).stop)
    ended = {"coverage": coverage, "collisions": steps, "return": coverage, "steps": steps}
    result = {
        "env_runners": {"num_env_steps_sampled": 128, "episodes": ended},
        "learners": {"default_policy": {"entropy": 1.0, "vf_explained_var": 0.5}},
    }
    line = history.take_result(result, 1.0)
    assert len(line["episodes"]) == len(history.episodes) == count
    assert line["rolling_coverage"] == (pytest.approx(0.2) if count else None)


def test_a_run_is_trained_resumed_after_a_kill_and_its_policy_used(settings, tmp_path):
    pytest.importorskip("ray", reason="Ray comes with `make setup-baselines`")
    from baselines.ppo.train import train

    folder = tmp_path / "run"
    assert train(settings(), folder)["stop"] == "steps"
    first = read(folder)
    (folder / "reached.json").unlink()
    with (folder / "progress.jsonl").open("a") as log:  # an iteration that a kill kept out of the checkpoint
        log.write(json.dumps(first[-1] | {"iteration": first[-1]["iteration"] + 1}) + '\n{"iteration": 7, "st')
    reached = train(settings("steps=1024"), folder)
    lines = read(folder)
    assert [line["iteration"] for line in lines] == list(range(1, len(lines) + 1))
    assert lines[: len(first)] == first
    assert reached["steps"] == lines[-1]["steps"] >= 1024
    policy = LearnedPolicy(folder / "policy.safetensors", 2, TaskParams())
    assert np.abs(policy.act(np.zeros((2, 19), np.float32), {})).max() <= 1
    with pytest.raises(BaselineError, match=r"run of other settings \(ppo\)"):
        train(settings("ppo.lr=0.1"), folder)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_a_run_shows_its_progress_without_a_terminal_and_ends_with_a_checkpoint(tee, tmp_path, kind):
    pytest.importorskip("ray", reason="Ray comes with `make setup-baselines`")
    project = Project(tmp_path / "mine", tiny=False)
    shutil.copytree(tee.bundle, project.folder / "artifacts/worlds/my-mine/realism/world")
    end_build(project.folder / "artifacts/worlds/my-mine")
    words = ["env=my-mine", "seed=1", "robots=4", "ppo.fragment=32", "ppo.minibatch=64", "ppo.epochs=1"]
    shown = tmp_path / "stderr.txt"
    with shown.open("w") as stderr:
        run = subprocess.Popen(
            [sys.executable, "-m", "baselines.ppo.train", *words],
            cwd=project.folder,
            stderr=stderr,
            stdout=subprocess.DEVNULL,
        )
        line = r"^my-mine-beams-mlp-1: .* [1-9]\d*/2000000 \[.* steps/s, coverage=.* %"
        try:
            while not re.search(line, shown.read_text(), flags=re.M):
                assert run.poll() is None, shown.read_text()
                time.sleep(0.5)
            run.send_signal(kind)
            assert run.wait() == 130
        finally:
            run.kill()
    text = shown.read_text()
    assert text.splitlines()[-1] == "train: interrupted; run it again to go on"
    assert "Traceback" not in text
    folder = project.folder / "artifacts/train/my-mine-beams-mlp-1"
    lines = read(folder)
    settings = TrainSettings.model_validate_json((folder / "settings.json").read_bytes())
    assert RunFolder(folder, settings).read_history().steps == lines[-1]["steps"] > 0  # no iteration is lost


@pytest.mark.parametrize("overrides", [["model=lstm", "model.cell=16", "model.sequence=8"], ["observation=map"]])
def test_what_is_exported_acts_as_what_was_trained(settings, tmp_path, overrides):
    pytest.importorskip("ray", reason="Ray comes with `make setup-baselines`")
    import torch
    import tree

    from baselines.ppo.algorithm import build_algorithm
    from baselines.ppo.export import export_policy

    chosen = settings(*overrides)
    algorithm = build_algorithm(chosen, 0)
    module = algorithm.get_module("default_policy")
    export_policy(module, chosen, {}, tmp_path / "p.safetensors")
    policy = LearnedPolicy(tmp_path / "p.safetensors", 3, TaskParams(), sample=False)
    rng = np.random.default_rng(0)
    poses = np.zeros((3, 3))
    state = tree.map_structure(lambda v: torch.zeros(3, *v.shape), module.get_initial_state())
    maps = LearnedPolicy(tmp_path / "p.safetensors", 3, TaskParams())._maps
    for _ in range(4):
        observation = rng.random((3, 19)).astype(np.float32)
        given = (
            observation if maps is None else np.hstack([observation, maps.observe(observation, {"pose_m_rad": poses})])
        )
        batch = {"obs": torch.tensor(given)}
        if state:
            batch = {"obs": batch["obs"][:, None], "state_in": state}
        with torch.no_grad():
            out = module.forward_inference(batch)
        state = out.get("state_out", {})
        mean = out["action_dist_inputs"].reshape(3, -1)[:, :2].numpy()
        np.testing.assert_allclose(policy.act(observation, {"pose_m_rad": poses}), np.clip(mean, -1, 1), atol=1e-5)
    algorithm.stop()


@pytest.mark.slow
def test_the_same_code_trains_on_a_cluster_of_two_nodes(built, tmp_path, monkeypatch):
    ray = pytest.importorskip("ray", reason="Ray comes with `make setup-baselines`")
    from ray.cluster_utils import Cluster

    from baselines.ppo.train import train

    monkeypatch.chdir(ROOT)
    if ray.is_initialized():
        ray.shutdown()
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    cluster.add_node(num_cpus=1)
    monkeypatch.setenv("RAY_ADDRESS", cluster.address)
    small = ["runners=2", "robots=4", "ppo.fragment=32", "ppo.minibatch=64", "ppo.epochs=1", "steps=512"]
    reached = train(compose_settings(small), tmp_path / "run")
    assert reached["steps"] >= 512
    assert len({n["NodeID"] for n in ray.nodes() if n["Alive"]}) == 2
    ray.shutdown()
    cluster.shutdown()


def test_curves_show_every_run_beside_the_paper(tmp_path):
    run = tmp_path / "runs" / "ChileanMineEntrance-beams-mlp-42"
    run.mkdir(parents=True)
    (run / "settings.json").write_text(compose_settings([]).model_dump_json())
    line = {
        "steps": 0,
        "steps_per_s": 1.0,
        "episodes": [{}],
        "rolling_coverage": None,
        "rolling_collisions": None,
        "rolling_return": None,
        "best_rolling_coverage": 0.0,
    }
    later = (
        {"rolling_coverage": 0.1 * i, "rolling_collisions": 2.0 / i, "rolling_return": 5.0 * i} for i in range(1, 5)
    )
    some = [
        line,
        *(line | rise | {"steps": 100 * i, "best_rolling_coverage": 0.1 * i} for i, rise in enumerate(later, 1)),
    ]
    (run / "progress.jsonl").write_text("".join(json.dumps(each) + "\n" for each in some))
    shutil.copytree(run, tmp_path / "runs" / "ChileanMineEntrance-beams-mlp-warp-42")
    curves.keep(tmp_path / "runs", tmp_path / "kept")
    runs = curves.read_runs(tmp_path / "kept")
    assert list(runs) == ["ChileanMineEntrance-beams-mlp", "ChileanMineEntrance-beams-mlp-warp"]
    text = curves.table(runs)
    assert "| 42 | unfinished | 400 | 5 | 40.00 | 40.00 | 1 | 6.7 | TC, 257, 100.0, 89.79 |" in text
    curves.draw_curves(runs, tmp_path / "c.png")
    assert (tmp_path / "c.png").stat().st_size > 10_000
    with pytest.raises(BaselineError, match="no runs"):
        curves.read_runs(tmp_path / "empty")
