"""Drivers to a goal, and their table."""

import gymnasium
import numpy as np
import pytest

import minexplore
from baselines.base.environments import known_ids
from baselines.base.errors import BaselineError
from baselines.explorers.to_goal import DRIVERS
from baselines.goto import GoalEpisode, drive, table
from minexplore.envs.vector import MineVectorEnv
from tests.mines import BuiltMine


@pytest.fixture
def tee_id(tee: BuiltMine):
    """Register the T-junction as a mine of one's own."""
    env_id = "MineXplore/goal-tee-v0"
    minexplore.register_env(env_id, {"world": str(tee.bundle)})
    yield env_id
    for name in (env_id, env_id.replace("/", "/GoTo-")):
        gymnasium.registry.pop(name)


def test_the_planner_reaches_every_goal_and_hardly_makes_a_detour(tee_id):
    level = {"terrain": False, "tilt": False}
    found = drive(tee_id, "planner", [0, 1, 2, 3], task=level)
    assert all(episode.success and episode.spl > 0.93 for episode in found)
    assert all(episode.time_s >= episode.shortest_s for episode in found)
    assert sum(episode.collisions for episode in found) == 0
    again = drive(tee_id, "planner", [2], task=level)
    assert again == found[2:3]


def test_both_drivers_drive_straight_where_the_way_is_straight(tee: BuiltMine):
    for driver in DRIVERS.values():
        env = MineVectorEnv(1, tee.bundle, {"terrain": False, "tilt": False}, goal={})
        observation, info = env.reset(seed=0, options={"pose": (10.0, 2.5, 0.0), "goal": (60.0, 2.5)})
        policy, over = driver(env.robots), np.zeros(1, bool)
        while not over.any():
            observation, _, terminated, truncated, info = env.step(policy.act(observation, info))
            over = terminated | truncated
        assert info["success"][0]
        assert info["spl"][0] > 0.97


def test_both_drivers_reach_a_goal_round_a_corner(tee: BuiltMine):
    """From the end of the side drift the goal is on the other side of rock."""
    reached = {}
    for name, driver in DRIVERS.items():
        env = MineVectorEnv(1, tee.bundle, {"terrain": False, "tilt": False, "max_steps": 900}, goal={})
        observation, info = env.reset(seed=0, options={"pose": (40.5, 38.0, 0.0), "goal": (76.0, 2.5)})
        policy, over = driver(env.robots), np.zeros(1, bool)
        while not over.any():
            observation, _, terminated, truncated, info = env.step(policy.act(observation, info))
            over = terminated | truncated
        reached[name] = bool(info["success"][0])
    assert reached == {"planner": True, "map-free": True}


def test_the_table_has_the_bound_and_the_means_of_each_driver():
    found = [GoalEpisode(True, 0.9, 20.0, 0, 0.8, 15.0), GoalEpisode(False, 0.0, 300.0, 4, 30.0, 25.0)]
    bound, row = table({"planner": found}).splitlines()[2:]
    assert bound.startswith("| bound | 100.0 % | 1.000 | 20.0 (")
    assert row.startswith("| planner | 50.0 % (0.0-100.0) | 0.450 (0.000-0.900) | 20.0 (20.0-20.0) | 2.0 (0.0-4.0) |")


def test_a_robot_that_flies_is_refused_and_no_explorer_is_compared_with_goals(tee_id, tee: BuiltMine):
    with pytest.raises(BaselineError, match="its robot flies; the drivers to a goal have wheels"):
        drive(tee_id, "planner", [0], robot="quadrotor")
    assert tee_id in known_ids()
    assert not [name for name in known_ids() if "GoTo" in name]
