import gymnasium
import numpy as np
import pytest
from pettingzoo.test import parallel_api_test, parallel_seed_test

from minexplore.envs.multi_agent import MineParallelEnv
from tests.mines import BuiltMine


def put(env, poses):
    """Place the team at poses of the mine frame, at rest."""
    for i, (x, y, yaw) in enumerate(poses):
        env.team.place(i, x, y, yaw)


def test_pettingzoos_own_tests_pass(tee: BuiltMine):
    parallel_api_test(MineParallelEnv(robots=2, world=tee.bundle, task={"max_steps": 40}), num_cycles=60)
    parallel_seed_test(lambda: MineParallelEnv(robots=2, world=tee.bundle), num_cycles=15)


def test_robots_start_apart(tee: BuiltMine):
    env = MineParallelEnv(robots=4, world=tee.bundle)
    _, infos = env.reset(seed=1)
    places = np.array([info["pose_m_rad"][:2] for info in infos.values()])
    apart = np.linalg.norm(places[:, None] - places, axis=-1)[np.triu_indices(4, 1)]
    assert apart.min() >= 1.2


def test_robots_hit_each_other_and_that_is_no_collision_with_rock(tee: BuiltMine):
    env = MineParallelEnv(robots=2, world=tee.bundle, task={"terrain": False})
    env.reset(seed=0)
    put(env, [(20.0, 2.5, 0.0), (22.0, 2.5, np.pi)])
    for _ in range(20):
        _, _, _, _, infos = env.step({a: np.array([0.5, 0.0], np.float32) for a in env.agents})
    x = [infos[a]["pose_m_rad"][0] for a in ("robot_0", "robot_1")]
    assert x[1] - x[0] == pytest.approx(2 * env.robot.radius_m, abs=0.05)
    assert all(info["collisions"] == 0 for info in infos.values())


@pytest.mark.parametrize("kind", ["shared", "individual"])
def test_the_teams_rewards_are_the_equation_of_the_teams_cells(tee: BuiltMine, kind):
    env = MineParallelEnv(robots=2, reward=kind, world=tee.bundle)
    _, infos = env.reset(seed=2)
    before = infos["robot_0"]["team_cells_seen"]
    seen = {a: infos[a]["cells_seen"] for a in env.agents}
    total = env.team.grid.total
    for _ in range(15):
        _, rewards, _, _, infos = env.step({a: np.array([1.0, 0.1], np.float32) for a in env.agents})
        new = {a: infos[a]["cells_seen"] - seen[a] for a in infos}
        team = infos["robot_0"]["team_cells_seen"]
        assert team - before == sum(new.values())
        if not any(info["collision"] for info in infos.values()) and (team < total / 4):
            if kind == "shared":
                expected = sum(new.values()) * 10 / total or -0.002
                assert list(rewards.values()) == pytest.approx([expected] * 2)
            else:
                assert list(rewards.values()) == pytest.approx([n * 10 / total or -0.002 for n in new.values()])
        before, seen = team, {a: infos[a]["cells_seen"] for a in infos}


def test_wrong_arguments_are_refused(tee: BuiltMine):
    with pytest.raises(ValueError, match="'shared' or 'individual'"):
        MineParallelEnv(reward="mine", world=tee.bundle)
    with pytest.raises(ValueError, match="no room near the entrance for robot"):
        MineParallelEnv(robots=400, world=tee.bundle).reset(seed=0)


@pytest.mark.parametrize("robots", [0, True, 2.5, 10**6])
def test_a_team_of_no_robots_or_of_more_than_a_model_holds_is_refused_at_once(tee, robots):
    with pytest.raises(ValueError, match=f"robots = {robots}, .*: want 1 to 1000"):
        MineParallelEnv(robots=robots, world=tee.bundle)


def test_calls_in_the_wrong_state_and_actions_that_are_no_dict_are_refused(tee: BuiltMine):
    env = MineParallelEnv(robots=2, world=tee.bundle, render_mode="rgb_array")
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset before render"):
        env.render()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step({})
    env.reset(seed=0)
    for actions, message in (
        (None, "want a dict with an action for each robot"),
        ([[0, 0], [0, 0]], "want a dict with an action for each robot"),
        ({"robot_0": np.zeros(2)}, "actions: none for 'robot_1'"),
        ({f"robot_{k}": np.zeros(2) for k in range(3)}, "unknown agent 'robot_2'; there are robot_0 to robot_1"),
    ):
        with pytest.raises(ValueError, match=message):
            env.step(actions)
    env.close()
    env.close()
    for call in (env.reset, env.render, lambda: env.step({})):
        with pytest.raises(gymnasium.error.ClosedEnvironmentError):
            call()
