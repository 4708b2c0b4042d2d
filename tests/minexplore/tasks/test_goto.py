"""The task with a goal: ends, figures with known answers, observations, draws, copies and refusals."""

import copy
import pickle
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import minexplore
from minexplore.envs.env import MineEnv
from minexplore.envs.family import FamilyEnv
from minexplore.envs.vector import MineVectorEnv
from minexplore.tasks.goto import GoalParams
from tests.mines import BuiltMine

LEVEL = {"terrain": False, "tilt": False}
ALONG = {"pose": (10.0, 2.5, 0.0), "goal": (60.0, 2.5)}


def made(bundle, **given):
    return MineEnv(bundle, **{"goal": {}, "task": LEVEL, **given})


def driven(env, options, commands):
    """Return the last step of an episode by a function of the bearing, and all ways left."""
    _, info = env.reset(seed=0, options=options)
    lefts = [float(info["way_left_m"])]
    bearing = 0.0
    for number in range(2000):
        observation, reward, terminated, truncated, info = env.step(commands(number, bearing))
        bearing = float(observation[-1])
        lefts.append(float(info["way_left_m"]))
        if terminated or truncated:
            break
    return reward, terminated, info, lefts


def ahead(number, bearing):
    return np.array([1.0, np.clip(2 * bearing, -1, 1)])


def test_a_straight_drive_along_a_straight_drift_has_an_spl_of_one(tee: BuiltMine):
    env = made(tee.bundle)
    reward, terminated, info, lefts = driven(env, ALONG, ahead)
    assert terminated
    assert info["success"]
    assert info["spl"] == pytest.approx(1.0, abs=0.02)
    assert lefts[0] == pytest.approx(50.0, abs=0.5)
    assert info["shortest_m"] == lefts[0] - 1.0
    assert lefts[-1] <= 1.0 < lefts[-2]
    assert info["time_s"] == pytest.approx(49.0 / 1.5, rel=0.05)
    assert info["collisions"] == 0
    assert reward == pytest.approx(10.0 - 0.01 + lefts[-2] - lefts[-1])


def test_a_way_that_begins_backwards_has_the_ratio_of_the_two_lengths(tee: BuiltMine):
    env = made(tee.bundle)
    options = {"pose": (30.0, 2.5, 0.0), "goal": (60.0, 2.5)}
    back = 80

    def backwards_first(number, bearing):
        return np.array([-1.0, 0.0]) if number < back else ahead(number, bearing)

    _, terminated, info, lefts = driven(env, options, backwards_first)
    extra = 2 * (max(lefts) - lefts[0])
    assert terminated
    assert extra > 10.0
    assert info["driven_m"] == pytest.approx(info["shortest_m"] + extra, rel=0.02)
    assert info["spl"] == info["shortest_m"] / info["driven_m"]
    assert info["spl"] == pytest.approx(29.0 / (29.0 + extra), rel=0.02)


def test_an_episode_without_success_is_cut_off_and_has_no_spl(tee: BuiltMine):
    env = made(tee.bundle, task={**LEVEL, "max_steps": 20})
    _, terminated, info, _ = driven(env, ALONG, ahead)
    assert not terminated
    assert not info["success"]
    assert info["spl"] == 0.0
    assert info["driven_m"] > 2.0


@pytest.mark.parametrize(("yaw", "bearing"), [(0.0, 0.0), (np.pi / 2, -np.pi / 2), (-np.pi / 2, np.pi / 2)])
def test_the_goal_is_observed_in_the_robots_frame(tee: BuiltMine, yaw, bearing):
    env = made(tee.bundle)
    observation, info = env.reset(seed=0, options={"pose": (10.0, 2.5, yaw), "goal": (30.0, 2.5)})
    goal = info["goal_m"] - [10.0, 2.5, 0.0]
    assert observation.shape == (21,)
    assert observation[-2] == pytest.approx(np.hypot(*goal[:2]), abs=1e-4)
    assert observation[-1] == pytest.approx(bearing + np.arctan2(goal[1], goal[0]), abs=1e-4)


def test_in_a_volume_the_goal_is_observed_ahead_to_the_left_and_up(ramp: Path):
    env = made(ramp)
    observation, info = env.reset(seed=0, options={"pose": (10.0, 0.0, 0.0), "goal": (50.0, 0.0, 3.0)})
    assert env.observation_space.contains(observation)
    assert observation.shape == (22,)
    np.testing.assert_allclose(observation[-3:], info["goal_m"] - [10.0, 0.0, 0.0], atol=0.05)
    assert info["goal_m"][2] == pytest.approx(3.0, abs=0.05)
    assert info["way_left_m"] == pytest.approx(20.0 + np.hypot(20.0, 3.0), abs=1.0)


@pytest.mark.parametrize("mine", ["tee", "ramp"])
def test_starts_and_goals_are_drawn_by_seed_at_the_stated_distances(mine, request):
    found = request.getfixturevalue(mine)
    env = made(getattr(found, "bundle", found), goal={"distance_m": (12.0, 30.0)})
    first = [env.reset(seed=seed)[1] for seed in range(12)]
    again = [env.reset(seed=seed)[1] for seed in range(12)]
    for one, two in zip(first, again, strict=True):
        assert 12.0 - 0.3 <= one["way_left_m"] <= 30.0 + 0.3
        assert {name: value.tolist() for name, value in one.items()} == {n: v.tolist() for n, v in two.items()}
    assert len({tuple(info["goal_m"].tolist()) for info in first}) > 8


def test_one_of_start_and_goal_may_be_fixed(tee: BuiltMine):
    env = made(tee.bundle, goal={"distance_m": (12.0, 30.0)})
    for options in ({"pose": (10.0, 2.5, 0.0)}, {"goal": (60.0, 2.5)}, {"goal": (60.0, 2.5), "noise_seed": 3}):
        drawn = [env.reset(seed=seed, options=options)[1] for seed in range(6)]
        fixed, free = ("pose_m_rad", "goal_m") if "pose" in options else ("goal_m", "pose_m_rad")
        assert len({tuple(info[fixed][:2].tolist()) for info in drawn}) == 1
        assert len({tuple(info[free][:2].tolist()) for info in drawn}) > 3
        assert all(11.7 <= info["way_left_m"] <= 30.3 for info in drawn)


def test_a_goal_may_be_a_station(tee: BuiltMine):
    env = made(tee.bundle)
    name, place = next((name, place) for name, place in tee.network.nodes_m.items())
    _, info = env.reset(seed=0, options={"goal": name})
    assert np.hypot(*(info["goal_m"][:2] - np.array(place)[:2])) <= 1.0


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP", "DISABLED"])
def test_vector_and_scalar_give_the_same_episodes_bit_for_bit_over_their_ends(tee: BuiltMine, mode):
    near = {"distance_m": (2.0, 4.0)}
    vector = MineVectorEnv(3, tee.bundle, LEVEL, goal=near, autoreset_mode=mode)
    single = [made(tee.bundle, goal=near) for _ in range(3)]
    many, many_info = vector.reset(seed=5)
    alone = [env.reset(seed=5 + i) for i, env in enumerate(single)]
    np.testing.assert_array_equal(many, [observation for observation, _ in alone])
    running, ends = [True] * 3, 0
    for _ in range(60):
        actions = np.column_stack([np.full(3, 0.8), np.clip(2 * many[:, -1], -1, 1)])
        many, rewards, terminated, truncated, many_info = vector.step(actions)
        for i in range(3):
            if not running[i]:
                continue
            observation, reward, done, over, info = single[i].step(actions[i])
            assert (rewards[i], terminated[i], truncated[i]) == (reward, done, over)
            own = many_info["final_info"] if mode == "SAME_STEP" and done else many_info
            assert {name: value.tolist() for name, value in info.items()} == {
                name: own[name][i].tolist() for name in info
            }
            assert {name: (value.dtype, value.shape) for name, value in info.items()} == {
                name: (own[name].dtype, own[name].shape[1:]) for name in info
            }
            if mode != "SAME_STEP" or not done:
                np.testing.assert_array_equal(many[i], observation)
            running[i], ends = not (done or over), ends + done
        if mode == "DISABLED" and (terminated | truncated).any():
            many, _ = vector.reset(options={"reset_mask": terminated | truncated})
    assert ends >= 2


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_as_the_original(tee: BuiltMine, copied):
    for env, action in (
        (made(tee.bundle), np.array([0.7, 0.3])),
        (MineVectorEnv(2, tee.bundle, LEVEL, goal={}), np.full((2, 2), 0.4)),
    ):
        env.reset(seed=2)
        env.step(action)
        twin = copied(env)
        for _ in range(15):
            ours, theirs = env.step(action), twin.step(action)
            np.testing.assert_array_equal(ours[0], theirs[0])
            np.testing.assert_array_equal(ours[1], theirs[1])
            assert {k: v.tolist() for k, v in ours[4].items()} == {k: v.tolist() for k, v in theirs[4].items()}


@pytest.mark.parametrize("robot", [None, "husky", "quadrotor"])
def test_gymnasiums_checker_passes_for_every_robot(tee: BuiltMine, robot):
    env = gymnasium.make("MineXplore/GoTo-v0", world=str(tee.bundle), robot=robot).unwrapped
    check_env(env, skip_render_check=True)


def test_sensors_stand_beside_the_goal(tee: BuiltMine):
    env = made(tee.bundle, sensors=("imu",))
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert observation["robot"].shape == (21,)


def test_each_mine_has_an_id_of_the_task_with_a_goal():
    for name in ("GoTo", "GoTo-ChileanMine", "GoTo-ChileanMineHusky", "GoTo-Family"):
        spec = gymnasium.spec(f"MineXplore/{name}-v0")
        assert spec.max_episode_steps == 3000
        assert spec.kwargs["goal"] == {}
    assert gymnasium.spec("MineXplore/GoTo-ChileanMineEntrance-v0").max_episode_steps == 1500
    assert minexplore.is_built_in("MineXplore/GoTo-v0")
    assert minexplore.is_built_in("MineXplore/GoTo-pell-v0")


def test_a_family_has_goals_and_options_of_the_task():
    env = FamilyEnv(goal={})
    assert env.observation_space.shape == (21,)
    with pytest.raises(ValueError, match="unknown 'place'; there are: mine, pose, cell, station, noise_seed, goal"):
        env.reset(options={"place": 1})
    with pytest.raises(ValueError, match="goal: radius_m = 0"):
        FamilyEnv(goal={"radius_m": 0})


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        ({"radius_m": -1.0}, "goal: radius_m = -1.0: want a number from 0.05 to 100"),
        ({"radius": 1.0}, "GoalParams: no field 'radius'; there are distance_m, radius_m"),
        ({"distance_m": (5.0, 2.0)}, r"goal: distance_m = \(5.0, 2.0\): want near <= far"),
        ({"distance_m": (0.5, 2.0)}, r"goal: distance_m = \(0.5, 2.0\): want more than radius_m = 1"),
        (3, "GoalParams: 3: want GoalParams"),
    ],
)
def test_goals_that_are_none_are_refused_in_one_line(tee: BuiltMine, goal, message):
    with pytest.raises(ValueError, match=message):
        MineEnv(tee.bundle, goal=goal)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"goal": "nowhere"}, "options: goal = 'nowhere': want one of"),
        ({"goal": (1.0,)}, "options: goal = .*: want a station's name, or x and y, m, mine frame"),
        ({"goal": (60.0, 20.0)}, "options: goal = .* from all places that the robot reaches; want at most radius_m"),
        ({"place": 1}, "options: unknown 'place'; there are: .*goal"),
    ],
)
def test_a_goal_that_cannot_be_reached_is_refused_and_changes_nothing(tee: BuiltMine, options, message):
    for env in (made(tee.bundle), MineVectorEnv(2, tee.bundle, goal={})):
        env.reset(seed=0)
        before = env.robots.state.copy()
        with pytest.raises(ValueError, match=message):
            env.reset(options=options)
        np.testing.assert_array_equal(env.robots.state, before)


def test_distances_that_a_mine_does_not_have_are_refused(tee: BuiltMine):
    env = made(tee.bundle, goal=GoalParams(distance_m=(500.0, 600.0)))
    with pytest.raises(ValueError, match="no starts at distance_m = 500 to 600"):
        env.reset(seed=0)


def test_what_has_no_goals_says_so(tee: BuiltMine, ramp: Path):
    with pytest.raises(ValueError, match="ways of a volume lead over floors; want a robot with wheels"):
        MineEnv(ramp, robot="quadrotor", goal={})
    with pytest.raises(ValueError, match="goal: backend = 'warp' has exploration alone"):
        gymnasium.make_vec("MineXplore/GoTo-v0", 2, world=str(tee.bundle), backend="warp")
    with pytest.raises(ValueError, match="options: unknown 'goal'"):
        MineEnv(tee.bundle).reset(options={"goal": (1.0, 1.0)})
