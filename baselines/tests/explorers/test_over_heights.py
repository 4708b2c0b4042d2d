"""Explorers and coverage in mines with heights."""

import gymnasium
import numpy as np
import pytest

from baselines.base.environments import require_trainable
from baselines.base.errors import BaselineError
from baselines.explorers import EXPLORERS, Explorer
from baselines.explorers.maps.layers import LayeredMap, Stance
from baselines.explorers.maps.own_map import FREE, ROCK, UNKNOWN
from baselines.explorers.reactive import Reactive
from baselines.policies.policy_lookup import make_policy
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
    assert kinds_at(own, own.layer, along) == [ROCK, ROCK]


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
    for heights, mapped in ((False, "FrontierTour"), (True, "FrontierTourOverHeights")):
        kinds = [type(make_policy(name, 1, TaskParams(), heights=heights)) for name in ("mapless", "frontier-tour")]
        assert [kind.__name__ for kind in kinds] == ["Reactive", mapped]


def test_a_learned_policy_that_maps_in_plan_refuses_a_mine_with_heights():
    name = "ChileanMineEntrance-map-mlp-42"
    with pytest.raises(BaselineError, match=f"policy = '{name}': its map is of level mines"):
        make_policy(name, 1, TaskParams(), heights=True)


@pytest.mark.parametrize("name", ["Family-beams-mlp-42", "graph-142"])
def test_a_learned_policy_drives_in_a_mine_with_heights(ramp, name):
    env = MineVectorEnv(2, world=ramp, task={"max_steps": 100, **DRY})
    policy = make_policy(name, 2, env.task, env.robot, env.world.has_heights)
    episodes = list(run_episodes(env, policy, [0, 1]))
    env.close()
    assert all(episode.path_m > 1.0 for episode in episodes)


def test_training_by_beams_takes_a_mine_with_heights_and_by_a_map_does_not(ramp):
    env_id = "MineXplore/Ramp-v0"
    gymnasium.register(
        env_id,
        "minexplore.envs.env:MineEnv",
        vector_entry_point="minexplore.envs.vector:MineVectorEnv",
        kwargs={"world": str(ramp)},
    )
    try:
        require_trainable(env_id, "beams")
        with pytest.raises(BaselineError, match=f"{env_id}: observation = 'map' is of level mines"):
            require_trainable(env_id, "map")
    finally:
        del gymnasium.registry[env_id]
