import sys

import gymnasium
import numpy as np
import pytest

import minexplore
from baselines import evaluate
from baselines.base.environments import find_id, make_env, require_trainable
from baselines.base.errors import BaselineError
from baselines.base.result_file import read_results
from baselines.explorers import EXPLORERS
from baselines.explorers.in_volume import NearestFrontierInVolume, body_axes
from baselines.explorers.maps.volume_map import FREE, ROCK, VolumeMap
from baselines.oracle.bound import best_walk
from baselines.oracle.other_robots import network_of
from baselines.policies.policy_lookup import fits, known_sha256, make_policy
from baselines.running.protocol import params_facts, run_episodes
from baselines.scoring.verified_runs import was_driven_here
from minexplore.envs.flyer_batch import FlyerBatch
from minexplore.physics.husky import HuskyParams
from minexplore.physics.quadrotor import QuadrotorParams
from minexplore.task import TaskParams
from tests.mines import BuiltMine

STEPS = 200


@pytest.fixture(scope="module")
def flying_id(tee: BuiltMine):
    """Return the id of the tee with a quadrotor and short episodes."""
    env_id = "MineXplore/flying-tee-v0"
    kwargs = {"world": str(tee.bundle), "robot": "quadrotor", "task": {"max_steps": STEPS}}
    gymnasium.register(env_id, minexplore.ENTRY_POINT, vector_entry_point=minexplore.VECTOR_ENTRY_POINT, kwargs=kwargs)
    yield env_id
    del gymnasium.registry[env_id]


@pytest.fixture(scope="module")
def network(flying_id):
    """Return the network of places that the quadrotor can come to."""
    env = make_env(flying_id, 1)
    yield network_of(env.robots, 4.0)
    env.close()


@pytest.mark.slow
def test_the_frontier_explorer_flies_through_the_tee_without_touching_it_and_stays_below_the_bound(flying_id, network):
    env = make_env(flying_id, 1)
    assert isinstance(env.robots, FlyerBatch)
    (episode,) = run_episodes(env, make_policy("nearest-frontier", 1, env.task, env.robot), [0])
    assert episode.collided == 0
    assert episode.seen[-1] > 2 * episode.seen[0]
    for seconds in (4.0, 12.0, 20.0):
        assert episode.seen[int(seconds / 2)] <= best_walk(network, seconds).most <= env.robots.grid.total
    env.close()


def test_a_map_of_a_box_is_free_inside_and_rock_at_its_walls():
    own = VolumeMap(2.0)
    rng = np.random.default_rng(0)
    ways = rng.normal(size=(4000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    half = np.array([3.0, 2.0, 1.5])
    ranges = (half / np.abs(ways)).min(axis=1)
    own.add(np.zeros(3), ways, ranges, 10.0)
    inside = own.at(rng.uniform(-0.8, 0.8, (50, 3)) * half)
    assert (own.fine[tuple(inside.T)] == FREE).all()
    wall = own.at(np.array([[3.1, 0.1, 0.1], [0.1, -2.1, 0.1], [0.1, 0.1, 1.6]]))
    assert (own.fine[tuple(wall.T)] == ROCK).all()
    assert own.path_to_frontier(np.zeros(3), 1.0, set()) is None  # the box is closed


def test_a_path_leads_to_the_only_side_of_a_box_that_is_open():
    own = VolumeMap(2.0)
    rng = np.random.default_rng(0)
    ways = rng.normal(size=(6000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    half = np.array([np.inf, 2.0, 1.5])  # open to east and west, and closed by rock in the west
    with np.errstate(divide="ignore"):
        ranges = (half / np.abs(ways)).min(axis=1)
    ranges = np.minimum(ranges, np.where(ways[:, 0] < 0, 3.0 / np.maximum(-ways[:, 0], 1e-9), np.inf))
    own.add(np.zeros(3), ways, np.minimum(ranges, 10.0), 10.0)
    path = own.path_to_frontier(np.zeros(3), 1.0, set())
    assert path is not None
    assert path[-1, 0] > 3.0
    assert np.abs(np.diff(path, axis=0)).max() <= own.fine_m + 1e-9


def test_attitudes_of_the_info_give_back_the_robots_axes():
    rng = np.random.default_rng(4)
    yaw, pitch, roll = rng.uniform(-3, 3, 20), rng.uniform(-0.4, 0.4, 20), rng.uniform(-0.4, 0.4, 20)
    axes = body_axes(yaw, pitch, roll)
    np.testing.assert_allclose(axes @ axes.transpose(0, 2, 1), np.broadcast_to(np.eye(3), (20, 3, 3)), atol=1e-12)
    np.testing.assert_allclose(np.arctan2(axes[:, 1, 0], axes[:, 0, 0]), yaw)
    np.testing.assert_allclose(axes[:, 2, :2], np.sin(np.column_stack([pitch, roll])))
    assert (np.linalg.det(axes) > 0).all()


def test_policies_that_drive_on_floors_are_refused_for_a_robot_that_flies():
    robot = QuadrotorParams()
    message = r"policy = 'reactive': it drives on floors; of robots that fly valid choices are nearest-frontier, module"
    with pytest.raises(BaselineError, match=message):
        make_policy("reactive", 1, TaskParams(), robot)
    assert [name for name in EXPLORERS if fits(name, robot)] == ["nearest-frontier"]
    assert all(fits(name, HuskyParams()) for name in EXPLORERS)
    assert known_sha256("nearest-frontier", False, flies=True) != known_sha256("nearest-frontier", False)


def test_training_refuses_the_tasks_of_other_robots():
    with pytest.raises(BaselineError, match="robot = 'husky': only policies of the default robot are trained"):
        require_trainable("ChileanMineHusky")


def test_the_robots_tasks_are_found_by_their_short_names_and_their_facts_name_the_robots_fields():
    for name in ("ChileanMineHusky", "ChileanMineQuadrotor"):
        assert find_id(name) in minexplore.ROBOT_TASKS
        assert minexplore.is_built_in(find_id(name))
    assert params_facts(HuskyParams())["side_ratio"] == HuskyParams().side_ratio
    assert isinstance(make_policy("nearest-frontier", 1, TaskParams(), QuadrotorParams()), NearestFrontierInVolume)


def test_results_that_an_explorer_was_driven_for_here_count_as_verified(flying_id, tmp_path, monkeypatch):
    results = tmp_path / "results"
    monkeypatch.setattr(evaluate, "RESULTS", results)
    monkeypatch.setattr(evaluate, "result_path", lambda policy, env: results / "flying" / f"{policy}.jsonl")
    words = ["evaluate", "--policy", "nearest-frontier", "--env", flying_id, "--episodes", "1", "--jobs", "1"]
    monkeypatch.setattr(sys, "argv", words)
    evaluate.main()
    path = results / "flying" / "nearest-frontier.jsonl"
    assert was_driven_here(path, results, *read_results(path))
