"""Explorers in worlds that are one volume."""

import pytest

from baselines.policies.policy_lookup import make_policy
from baselines.running.protocol import run_episodes
from minexplore.envs.vector import MineVectorEnv

DRY = {"terrain": False}


def explored(world, name, steps):
    env = MineVectorEnv(1, world=world, task={"max_steps": steps, **DRY})
    policy = make_policy(name, 1, env.task, env.robot, env.world.has_heights)
    (episode,) = run_episodes(env, policy, [0])
    env.close()
    return episode, env.robots.grid


@pytest.mark.slow
@pytest.mark.parametrize("name", ["nearest-frontier", "graph-142"])
def test_a_frontier_explorer_sees_passages_over_and_under_each_other(over, name):
    episode, grid = explored(over, name, 1300)
    assert episode.seen[-1] > 0.95 * grid.total
    assert episode.collided < 5


@pytest.mark.slow
def test_wall_following_drives_down_a_ramp_into_the_passage_below(over):
    episode, grid = explored(over, "wall-following", 1300)
    assert episode.seen[-1] > 0.6 * grid.total
