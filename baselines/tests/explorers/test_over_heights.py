"""Explorers and coverage in mines with heights."""

import gymnasium
import numpy as np
import pytest

from baselines.base.environments import require_trainable
from baselines.explorers import EXPLORERS, Explorer
from baselines.explorers.frontier import NearestFrontier
from baselines.explorers.graph_explorer import GraphExplorer
from baselines.explorers.maps.layers import LayeredMap, Stance
from baselines.explorers.maps.own_map import FREE, ROCK, UNKNOWN
from baselines.explorers.reactive import Reactive
from baselines.policies.map_observation import MapObserver
from baselines.policies.policy_lookup import make_policy
from baselines.ppo.training_env import make_training_env
from baselines.running.protocol import run_episodes
from minexplore.envs.vector import MineVectorEnv
from minexplore.task import TaskParams

LEVEL = np.eye(3)[:2]
BEARINGS = np.radians([0.0, 90.0, 180.0, 270.0])
SENSOR_M, FAR_M = 0.5, 10.0
DRY = {"terrain": False}  # mud and water on a decline of 13 % are slippery: robots slide there


def kinds_at(own, number, places):
    layer = own.layers[number]
    return layer.fine[layer.at(np.array(places), layer.fine_m)].tolist()


def test_passages_over_each_other_are_in_different_layers():
    own = LayeredMap(2.0)
    own.add_scan(Stance(np.array([5.0, 5.0]), 100.0, LEVEL), BEARINGS, np.array([1.0, 9.0, 1.0, 9.0]), SENSOR_M, FAR_M)
    own.add_scan(Stance(np.array([5.0, 5.0]), 104.1, LEVEL), BEARINGS, np.array([9.0, 1.0, 9.0, 1.0]), SENSOR_M, FAR_M)
    across, along = [(6.1, 5.0), (3.9, 5.0)], [(5.0, 6.1), (5.0, 3.9)]
    for number in own.layers:
        lower = any(kind == ROCK for kind in kinds_at(own, number, across))
        upper = any(kind == ROCK for kind in kinds_at(own, number, along))
        assert not (lower and upper)
    assert kinds_at(own, 0, across) == [ROCK, ROCK]
    assert kinds_at(own, 0, along) == [FREE, FREE]
    assert kinds_at(own, own.layer_of[0], along) == [ROCK, ROCK]


def test_a_floor_that_rises_is_taken_for_rock_until_it_is_doubted_and_never_where_its_height_is_known():
    ahead, ramp = np.array([0.0]), 0.15
    own = LayeredMap(2.0)
    own.add_scan(Stance(np.zeros(2), 0.0, LEVEL), ahead, np.array([SENSOR_M / ramp]), SENSOR_M, FAR_M)
    end = [(SENSOR_M / ramp + 0.1, 0.0)]
    assert kinds_at(own, 0, end) == [ROCK]
    assert own.doubt([0])
    assert kinds_at(own, 0, end) == [UNKNOWN]
    own.add_scan(Stance(np.zeros(2), 0.0, LEVEL), ahead, np.array([SENSOR_M / ramp]), SENSOR_M, FAR_M)
    assert kinds_at(own, 0, end) == [FREE]
    own.add_scan(Stance(np.array([2.3, 0.0]), 0.0, LEVEL), ahead, np.array([1.0]), SENSOR_M, FAR_M)
    assert kinds_at(own, 0, end) == [ROCK]  # so near it is none but rock
    assert not own.doubt([0])


def test_one_table_has_each_explorer_for_level_mines_and_for_mines_with_heights(monkeypatch):
    monkeypatch.setitem(EXPLORERS, "mapless", Explorer(Reactive))
    for heights, nearest in ((False, NearestFrontier), (True, GraphExplorer)):
        kinds = [type(make_policy(name, 1, TaskParams(), heights=heights)) for name in ("mapless", "nearest-frontier")]
        assert kinds == [Reactive, nearest]


def test_a_map_of_height_layers_shows_the_robots_own_and_keeps_it_on_the_way_from_one_to_the_next():
    maps, poses = MapObserver(1, TaskParams()), np.zeros((1, 3))
    wide = np.ones((1, 19), dtype=np.float32)
    shares = [maps.observe(wide, {"pose_m_rad": poses, "height_m": np.array([h])}) for h in (0.5, 4.5)]
    np.testing.assert_array_equal(*shares)  # the drift over the first one is seen as if that were not there
    before = maps.seen.sum()
    seen = maps.observe(0 * wide, {"pose_m_rad": poses, "height_m": np.array([3.2])})[0, : maps.size // 3]
    assert seen.max() == 1.0  # the layer that it comes into was drawn from under it and from over it
    assert maps.seen.sum() == before


@pytest.mark.parametrize("name", ["Family-beams-mlp-42", "ChileanMineEntrance-map-mlp-42", "graph-142"])
def test_a_learned_policy_drives_in_a_mine_with_heights(ramp, name):
    env = MineVectorEnv(2, world=ramp, task={"max_steps": 100, **DRY})
    policy = make_policy(name, 2, env.task, env.robot, env.world.has_heights)
    episodes = list(run_episodes(env, policy, [0, 1]))
    env.close()
    assert all(episode.path_m > 1.0 for episode in episodes)


def test_a_mine_with_heights_is_trained_in(ramp):
    env_id = "MineXplore/Ramp-v0"
    gymnasium.register(
        env_id,
        "minexplore.envs.env:MineEnv",
        vector_entry_point="minexplore.envs.vector:MineVectorEnv",
        kwargs={"world": str(ramp)},
    )
    try:
        require_trainable(env_id)
        env = make_training_env(
            {"env": env_id, "mines": 1, "num_envs": 2, "observation": "map", "reward_scale": 1.0, "cell_bonus": 0.0}
            | {"seed": 0}
        )
        first, _ = env.reset(seed=0)
        assert first.shape == env.observation_space.shape
        assert np.isfinite(env.step(np.ones((2, 2)))[0]).all()
        env.close()
    finally:
        del gymnasium.registry[env_id]
