"""What a robot knows beside its sensors, as entries of its observation."""

import copy

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from minexplore.envs.env import MineEnv
from minexplore.sensing.odometry import fitted_odometry
from tests.mines import BuiltMine

NAMES = ("pose", "odometry", "map", "goal")
AHEAD = np.array([1.0, 0.1], np.float32)


def test_all_four_are_in_their_spaces_and_pass_gymnasiums_checks(tee: BuiltMine):
    env = MineEnv(tee.bundle, sensors=NAMES, goal={})
    check_env(env, skip_render_check=True)
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    assert [observation[name].shape for name in NAMES] == [(6,), (3,), (33, 33), (3,)]


def test_pose_and_goal_are_those_of_the_info(tee: BuiltMine):
    env = MineEnv(tee.bundle, sensors=NAMES, goal={})
    env.reset(seed=2, options={"pose": (10.0, 2.5, np.pi / 2), "goal": (30.0, 2.5)})
    observation, *_, info = env.step(np.array([0.0, 0.3]))
    x, y, yaw = info["pose_m_rad"]
    want = [x, y, info["height_m"], yaw, info["pitch_rad"], info["roll_rad"]]
    np.testing.assert_allclose(observation["pose"], want, atol=1e-5)
    ahead, left, _ = observation["goal"]
    assert np.hypot(ahead, left) == pytest.approx(observation["robot"][-2], abs=0.01)
    assert np.arctan2(left, ahead) == pytest.approx(observation["robot"][-1], abs=1e-3)
    assert left == pytest.approx(-20.0, abs=0.5)


def test_odometry_begins_at_the_true_pose_and_drifts_from_it(tee: BuiltMine):
    env = MineEnv(tee.bundle, sensors=("odometry", "pose"), task={"terrain": False, "tilt": False})
    observation, _ = env.reset(seed=3, options={"pose": (10.0, 2.5, 0.0)})
    np.testing.assert_allclose(observation["odometry"], observation["pose"][[0, 1, 3]], atol=1e-6)
    for _ in range(200):
        observation = env.step(np.array([1.0, 0.0], np.float32))[0]
    off = np.abs(observation["odometry"] - observation["pose"][[0, 1, 3]])
    fit, driven_m = fitted_odometry(), 30.0
    most_rad = 4 * (fit.heading_drift_radpm * driven_m + fit.heading_noise_rad_rtm * np.sqrt(driven_m))
    assert 0.0 < off[2] < most_rad
    assert 0.0 < off[:2].max() < most_rad * driven_m
    twice = env.capture("odometry")
    np.testing.assert_array_equal(twice, env.capture("odometry"))


def test_the_map_holds_the_cells_that_were_seen_round_the_robot(tee: BuiltMine):
    env = MineEnv(tee.bundle, sensors=("map",))
    observation, info = env.reset(seed=0)
    for _ in range(60):
        observation, *_, info = env.step(AHEAD)
    grid, (x, y) = env.grid, info["pose_m_rad"][:2]
    column, row = np.floor((np.array([x, y]) - grid.origin_m) / grid.cell_m).astype(int)
    assert observation["map"].sum() == info["cells_seen"] > 5  # the whole mine is not wider than the map
    assert observation["map"][16, 16] == env.robots.seen[0, row, column]
    assert observation["map"][16, 17] == env.robots.seen[0, row, column + 1]


def test_copies_read_on_and_vectors_of_copies_hold_them(tee: BuiltMine):
    one = MineEnv(tee.bundle, sensors=("odometry", "map"))
    one.reset(seed=4)
    one.step(AHEAD)
    two = copy.deepcopy(one)
    for _ in range(5):
        ours, theirs = one.step(AHEAD)[0], two.step(AHEAD)[0]
        for name in ours:
            np.testing.assert_array_equal(ours[name], theirs[name])
    many = gymnasium.make_vec("MineXplore/GoTo-v0", 2, "sync", world=str(tee.bundle), sensors=NAMES)
    observation, _ = many.reset(seed=0)
    assert observation["map"].shape == (2, 33, 33)
    many.close()


def test_what_a_robot_or_a_task_does_not_have_is_refused(tee: BuiltMine):
    with pytest.raises(ValueError, match="sensors: 'goal': the task has no goal"):
        MineEnv(tee.bundle, sensors=("goal",)).reset(seed=0)
    with pytest.raises(ValueError, match="sensors: 'odometry': this robot has no wheels"):
        MineEnv(tee.bundle, sensors=("odometry",), robot="quadrotor").reset(seed=0)
