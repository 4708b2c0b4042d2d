import gymnasium
import numpy as np
import pytest

import minexplore
from tests.mines import BuiltMine

pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 is not installed (extra sb3)")

from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from minexplore.extra.sb3 import MineVecEnv

TEE_ID = "MineXplore/World-v0"


def make(tee, count, **task):
    return MineVecEnv(TEE_ID, count, world=tee.bundle, max_episode_steps=7, task=task)


def test_it_gives_what_sb3_s_own_vector_of_scalar_environments_gives(tee: BuiltMine):
    kwargs = {"world": str(tee.bundle), "max_episode_steps": 7}
    theirs = DummyVecEnv([lambda: gymnasium.make(TEE_ID, **kwargs) for _ in range(3)])
    ours = make(tee, 3)
    for env in (theirs, ours):
        env.seed(11)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    rng = np.random.default_rng(0)
    for _ in range(20):
        actions = rng.uniform(-1, 1, (3, 2)).astype(np.float32)
        a, b = ours.step(actions), theirs.step(actions)
        for mine, other in zip(a[:3], b[:3], strict=True):
            np.testing.assert_array_equal(mine, other)
            assert mine.dtype == other.dtype
        for mine, other in zip(a[3], b[3], strict=True):
            assert mine.keys() == other.keys()
            assert mine["TimeLimit.truncated"] == other["TimeLimit.truncated"]
            assert mine["cells_seen"] == other["cells_seen"]
            np.testing.assert_array_equal(mine["pose_m_rad"], other["pose_m_rad"])
            np.testing.assert_array_equal(mine.get("terminal_observation", 0), other.get("terminal_observation", 0))
        for mine, other in zip(ours.reset_infos, theirs.reset_infos, strict=True):
            np.testing.assert_array_equal(mine["pose_m_rad"], other["pose_m_rad"])
    ours.close()


def test_attributes_and_methods_are_those_of_the_one_environment(tee: BuiltMine):
    env = make(tee, 3)
    assert env.get_attr("num_envs", indices=[0, 2]) == [3, 3]
    assert env.env_is_wrapped(gymnasium.Wrapper) == [False] * 3
    env.set_attr("camera", "top")
    assert env.get_attr("camera") == ["top"] * 3
    assert env.env_method("render") == [None] * 3
    assert not env.has_attr("nothing of the kind")
    with pytest.raises(ValueError, match=r"set_attr\('camera', indices=0\): the robots share one environment"):
        env.set_attr("camera", "chase", indices=0)
    with pytest.raises(ValueError, match="'MineXplore/Moon-v0': valid choices are MineXplore/World-v0"):
        MineVecEnv("MineXplore/Moon-v0", 1)
    env.close()


def test_a_picture_shows_all_robots(tee: BuiltMine):
    env = MineVecEnv(TEE_ID, 2, world=tee.bundle, render_mode="rgb_array", camera="top")
    env.reset()
    assert env.render().size == 2 * 480 * 640 * 3  # tiled by Stable-Baselines3
    env.close()


def test_ppo_learns_for_a_moment_on_the_built_world(built):
    world = built.folder / "artifacts" / "realism" / "world"
    env = VecMonitor(MineVecEnv(TEE_ID, 4, world=world, max_episode_steps=40, task={"region_m": 40.0}))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, n_epochs=1, seed=3, device="cpu")
    before = [p.clone() for p in model.policy.parameters()]
    model.learn(512)
    assert model.num_timesteps == 512
    assert any((a != b).any() for a, b in zip(before, model.policy.parameters(), strict=True))
    assert len(model.ep_info_buffer) >= 8
    mean, _ = evaluate_policy(model, env, n_eval_episodes=4)
    assert np.isfinite(mean)
    env.close()


def test_a_prefix_is_taken_and_a_refusal_names_every_environment_and_the_family(tee: BuiltMine):
    env = MineVecEnv("minexplore:MineXplore/World-v0", 2, world=str(tee.bundle))
    assert env.reset().shape == (2, 19)
    env.close()
    with pytest.raises(ValueError, match=r"env_id = 'MineXplore/None-v0': valid choices are ") as error:
        MineVecEnv("MineXplore/None-v0", 2)
    assert all(env_id in str(error.value) for env_id in (*minexplore.WORLDS, minexplore.FAMILY))
