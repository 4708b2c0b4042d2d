"""Teams of any robot, with goals, sensors and options: each robot is in all else the robot that is alone."""

import copy

import gymnasium
import numpy as np
import pytest
from pettingzoo.test import parallel_api_test

from minexplore.envs.env import MineEnv
from minexplore.envs.multi_agent import MineParallelEnv
from minexplore.sensing.scanners.labels import NUMBERS
from tests.mines import BuiltMine

LEVEL = {"terrain": False, "tilt": False}
SENSORS = ("pose", "odometry", "map", "goal", "imu")


def facing(env, ahead_m=4.0):
    """Reset a team of two and let both face each other in a drift."""
    env.reset(seed=0)
    env.team.place(0, 20.0, 2.5, 0.0)
    env.team.place(1, 20.0 + ahead_m, 2.5, np.pi)


def everyone(env, action):
    return dict.fromkeys(env.agents, np.asarray(action, dtype=float))


@pytest.mark.parametrize(("robot", "action"), [("husky", [0.6, 0.0]), ("quadrotor", [0.4, 0.0, 0.0, 0.0])])
def test_robots_of_any_kind_hold_each_other_up(tee: BuiltMine, robot, action):
    env = MineParallelEnv(2, world=tee.bundle, robot=robot, task=LEVEL)
    facing(env, 2.5)
    for _ in range(40):
        infos = env.step(everyone(env, action))[4]
    x = [info["pose_m_rad"][0] for info in infos.values()]
    y = [info["pose_m_rad"][1] for info in infos.values()]
    assert np.hypot(x[1] - x[0], y[1] - y[0]) > 2 * env.robot.radius_m - 0.1
    assert x[1] > x[0]


@pytest.mark.parametrize(
    ("robot", "conditions"), [(None, "ideal"), ("husky", "ideal"), ("quadrotor", "ideal"), ("husky", "typical")]
)
def test_beams_of_any_kind_hit_the_other_robot(tee: BuiltMine, robot, conditions):
    env = MineParallelEnv(2, world=tee.bundle, robot=robot, conditions=conditions, task=LEVEL)
    facing(env)
    radius_m = env.robot.radius_m if env.robot.FLIES else env.robot.scanner_radius_m
    assert env.team.true_ranges(np.arange(2))[:, 0] == pytest.approx(4.0 - radius_m, abs=0.02)
    measured = env.team._cast(np.arange(2))[2][:, 0]
    assert measured == pytest.approx(4.0 - radius_m, abs=0.1)
    env.team.place(1, 24.0, 3.5, np.pi)
    assert env.team.true_ranges(np.arange(2))[0, 0] == 10.0  # past the other one


def test_a_flyer_over_another_is_hit_by_the_beam_upwards(tee: BuiltMine):
    env = MineParallelEnv(2, world=tee.bundle, robot="quadrotor", task=LEVEL)
    facing(env)
    below, above = env.team.qpos[0], env.team.qpos[1]
    above[:3] = below[:3]
    above[[0, 2]] += [0.1, 0.8]
    down, up = env.team.true_ranges(np.arange(2))[:, -2:].T
    assert up[0] == down[1] == pytest.approx(0.8 - env.robot.half_height_m, abs=1e-6)


def test_clouds_and_images_of_a_team_hold_the_other_robot_and_not_the_own_one(small_world):
    sensors = ("mid-360", "labels", "depth")
    team, one = MineParallelEnv(2, world=small_world, sensors=sensors), MineEnv(small_world, sensors=sensors)
    observed, infos = team.reset(seed=0)
    assert team.observation_space("robot_0") == one.observation_space
    assert all(team.observation_space(agent).contains(found) for agent, found in observed.items())
    x, y, _ = infos["robot_0"]["pose_m_rad"]
    free = team.world.places_m(0.5)
    away = free - [x, y]
    near = np.hypot(*away.T)
    ahead = away[(near > 2.0) & (near < 3.0)][0]
    turn = np.arctan2(ahead[1], ahead[0])
    team.team.place(0, x, y, turn)
    team.team.place(1, x + ahead[0], y + ahead[1], turn)
    suite = team._sensed._suites[0]
    cloud, labels, depth = suite.capture("mid-360"), suite.capture("labels"), suite.capture("depth")
    of_robot = cloud.label == NUMBERS["robot"]
    assert of_robot.sum() > 20
    assert np.hypot(*cloud.points_m[of_robot, :2].T).min() > 1.0
    seen = labels == NUMBERS["robot"]
    assert 1.0 < depth[seen].min() < 3.0
    assert np.median(depth[seen]) == pytest.approx(np.median(cloud.points_m[of_robot, 0]) - 0.36, abs=0.4)
    team.team.place(1, x, y + 100.0, 0.0)
    assert not (suite.capture("mid-360").label == NUMBERS["robot"]).any()
    team.close()
    one.close()


def test_a_team_of_one_is_the_robot_alone_with_its_goal_and_sensors(tee: BuiltMine):
    given = {"world": tee.bundle, "goal": {}, "sensors": SENSORS, "pose": "odometry", "conditions": "dusty"}
    team, one = MineParallelEnv(1, **given), MineEnv(**given)
    (found, infos), (observed, info) = team.reset(seed=5), one.reset(seed=5)
    assert team.observation_space("robot_0") == one.observation_space
    for step in range(10):
        for name, value in observed.items():
            np.testing.assert_allclose(found["robot_0"][name], value, atol=2e-5, err_msg=f"{name} at {step}")
        np.testing.assert_array_equal(infos["robot_0"]["goal_m"], info["goal_m"])
        found, rewards, _, _, infos = team.step({"robot_0": np.array([0.5, 0.1])})
        observed, reward, _, _, info = one.step(np.array([0.5, 0.1]))
        assert rewards["robot_0"] == pytest.approx(reward, abs=1e-4)


def test_a_robot_at_its_goal_leaves_the_team_and_stays_there(tee: BuiltMine):
    env = MineParallelEnv(2, world=tee.bundle, task=LEVEL, goal={}, reward="individual")
    env.reset(seed=0, options={"pose": (20.0, 2.5, 0.0), "goal": (26.0, 2.5)})
    env.team.place(0, 24.0, 2.5, 0.0)
    env.team.place(1, 20.0, 1.6, 0.0)
    arrived = None
    for _ in range(60):
        _, rewards, terminated, truncated, infos = env.step(everyone(env, [0.6, 0.0]))
        if terminated.get("robot_0"):
            assert infos["robot_0"]["success"]
            assert rewards["robot_0"] > 9.0
            arrived = env.team.poses()[0, :2].copy()
        if not env.agents:
            break
        assert not any(truncated.values())
    assert arrived is not None
    assert list(terminated) == ["robot_1"]
    assert terminated["robot_1"]
    np.testing.assert_allclose(env.team.poses()[0, :2], arrived, atol=0.15)


def test_a_team_begins_at_a_place_side_by_side(tee: BuiltMine):
    env = MineParallelEnv(3, world=tee.bundle)
    infos = env.reset(seed=0, options={"pose": (20.0, 2.5, 1.0)})[1]
    poses = np.array([info["pose_m_rad"] for info in infos.values()])
    np.testing.assert_allclose(poses[0], [20.0, 2.5, 1.0], atol=1e-9)
    np.testing.assert_allclose(poses[:, 2], 1.0, atol=1e-9)
    apart = np.linalg.norm(poses[:, None, :2] - poses[:, :2], axis=-1)[np.triu_indices(3, 1)]
    assert 1.2 <= apart.min() <= 1.5
    assert apart.max() < 3.0


def test_the_shared_reward_of_goals_is_the_sum_of_the_robots_own(tee: BuiltMine):
    teams = [MineParallelEnv(2, world=tee.bundle, goal={}, reward=kind) for kind in ("shared", "individual")]
    for env in teams:
        env.reset(seed=1)
    shared, individual = (env.step(everyone(env, [0.5, 0.0]))[1] for env in teams)
    assert list(shared.values()) == pytest.approx([sum(individual.values())] * 2)


def test_pettingzoos_own_test_passes_with_goals_and_sensors(tee: BuiltMine):
    env = MineParallelEnv(2, world=tee.bundle, task={"max_steps": 20}, goal={}, sensors=("pose", "goal"))
    parallel_api_test(env, num_cycles=30)


def test_a_copy_of_a_team_with_goals_and_sensors_goes_on_as_the_team(tee: BuiltMine):
    env = MineParallelEnv(2, world=tee.bundle, robot="husky", goal={}, sensors=SENSORS, conditions="dusty")
    env.reset(seed=2)
    env.step(everyone(env, [0.5, 0.1]))
    twin = copy.deepcopy(env)
    for _ in range(3):
        ours, theirs = (one.step(everyone(one, [0.5, 0.1])) for one in (env, twin))
    for agent, observed in ours[0].items():
        for name, value in observed.items():
            np.testing.assert_array_equal(value, theirs[0][agent][name])
    assert ours[1] == theirs[1]


def test_a_fallen_robot_of_a_team_is_braked_as_one_alone(over):
    env = MineParallelEnv(1, world=over, task={"terrain": False})
    env.reset(seed=0)
    env.team.qpos[0, 2] += 3.0
    env.team.qvel[0, 2] = -20.0
    env.step(everyone(env, [0.0, 0.0]))
    assert env.team.qvel[0, 2] > -5.0


def test_a_team_draws_what_it_sees_without_a_display(small_world):
    env = MineParallelEnv(2, world=small_world, robot="husky", render_mode="rgb_array", camera="chase")
    env.reset(seed=0)
    assert env.render().std() > 5
    env.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError):
        env.render()
