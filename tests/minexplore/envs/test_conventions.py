"""What clients of Gymnasium and PettingZoo rely on: infos, horizons, modes, seeds, copies and where episodes begin."""

import copy
import json
import pickle
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeAwareObservation

from minexplore.bundle import TOPOLOGY
from minexplore.envs.env import MineEnv
from minexplore.envs.multi_agent import MineParallelEnv
from minexplore.envs.vector import MineVectorEnv
from tests.mines import BuiltMine

ID = "MineXplore/World-v0"


def kinds_of(info):
    """Return the dtype and shape of each entry of one robot's info; every entry must be an array of numbers."""
    assert all(isinstance(value, np.ndarray) and value.dtype.kind in "bif" for value in info.values()), info
    return {name: (value.dtype, value.shape) for name, value in info.items()}


def test_infos_have_the_same_arrays_of_numbers_in_all_forms(tee: BuiltMine):
    single, vector, team = MineEnv(tee.bundle), MineVectorEnv(3, tee.bundle), MineParallelEnv(3, world=tee.bundle)
    sync = SyncVectorEnv([lambda: MineEnv(tee.bundle)] * 3)
    after = [env.reset(seed=0)[1] for env in (single, vector, team, sync)]
    stepped = [
        single.step(np.zeros(2))[4],
        vector.step(np.zeros((3, 2)))[4],
        team.step(dict.fromkeys(team.agents, np.zeros(2)))[4],
        sync.step(np.zeros((3, 2)))[4],
    ]
    for one, many, of_team, theirs in (after, stepped):
        want = kinds_of(one)
        assert {name: (kind, (3, *shape)) for name, (kind, shape) in want.items()} == {
            name: found for name, found in kinds_of(many).items() if not name.startswith("_")
        }
        assert kinds_of(many) == kinds_of(theirs)
        for info in of_team.values():
            own = kinds_of(info)
            assert {name: own.pop(name)[1] for name in ("team_cells_seen", "team_coverage")} == {
                "team_cells_seen": (),
                "team_coverage": (),
            }
            assert own == want
    sync.close()


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_team_is_copied_when_it_is_new_and_while_it_drives(tee: BuiltMine, copied):
    team = MineParallelEnv(robots=2, world=tee.bundle)
    twin = copied(team)
    for env in (team, twin):
        env.reset(seed=4)
    actions = dict.fromkeys(team.agents, np.array([0.5, 0.2], np.float32))
    for _ in range(5):
        team.step(actions)
        twin.step(actions)
    later = copied(team)
    for _ in range(5):
        results = [env.step(actions) for env in (team, twin, later)]
    for found in results[1:]:
        for agent, observation in results[0][0].items():
            np.testing.assert_array_equal(observation, found[0][agent])
        assert results[0][1] == found[1]
        assert results[0][4]["robot_0"]["team_cells_seen"] == found[4]["robot_0"]["team_cells_seen"]


@pytest.mark.parametrize(("asked", "steps"), [(None, 6000), (5, 5), (9000, 9000)])
def test_the_horizon_is_that_of_the_spec_in_the_scalar_and_in_the_vector_form(tee: BuiltMine, asked, steps):
    given = {} if asked is None else {"max_episode_steps": asked}
    single = gymnasium.make(ID, world=str(tee.bundle), **given)
    vector = gymnasium.make_vec(ID, 2, world=str(tee.bundle), **given)
    assert single.spec.max_episode_steps == vector.spec.max_episode_steps == vector.task.max_steps == steps
    assert gymnasium.spec(ID).max_episode_steps == 6000
    assert TimeAwareObservation(single).observation_space.contains(TimeAwareObservation(single).reset(seed=0)[0])
    if asked == 5:
        single.reset(seed=0)
        vector.reset(seed=0)
        for step in range(5):
            assert single.step(np.array([0.5, 0.0]))[3] == (step == 4)
            assert vector.step(np.full((2, 2), 0.1))[3].all() == (step == 4)


def test_a_horizon_above_the_tasks_own_holds(tee: BuiltMine):
    env = gymnasium.make(ID, world=str(tee.bundle), max_episode_steps=6010)
    env.reset(seed=0)
    env.unwrapped.robots.steps[:] = 6003
    assert not env.step(np.array([0.5, 0.0]))[3]


@pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
def test_a_second_horizon_in_the_task_is_refused(tee: BuiltMine, make):
    with pytest.raises(ValueError, match=r"task: max_steps = 9: .* want max_episode_steps=9 instead"):
        make(ID, world=str(tee.bundle), task={"max_steps": 9})


def test_seeds_of_the_vector_are_those_of_sync(tee: BuiltMine):
    vector, sync = MineVectorEnv(3, tee.bundle), SyncVectorEnv([lambda: MineEnv(tee.bundle)] * 3)
    assert len(set(vector.np_random_seed)) == 3
    for env in (vector, sync):
        env.reset(seed=1)
        assert tuple(env.np_random_seed) == (1, 2, 3)
    for env in (vector, sync):
        env.reset(seed=[None, 9, None], options={"reset_mask": np.array([False, True, False])})
        assert tuple(env.np_random_seed) == (1, 9, 3)
    sync.close()


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_every_autoreset_mode_is_an_attribute_and_in_the_metadata(tee: BuiltMine, mode):
    env = gymnasium.make_vec(ID, 2, world=str(tee.bundle), autoreset_mode=mode)
    assert env.autoreset_mode is env.metadata["autoreset_mode"] is mode


def test_without_autoreset_a_robot_waits_for_its_mask(tee: BuiltMine):
    env = MineVectorEnv(2, tee.bundle, max_episode_steps=2, autoreset_mode="DISABLED")
    env.reset(seed=0)
    env.step(np.zeros((2, 2)))
    env.reset(options={"reset_mask": np.array([True, False])})
    assert env.step(np.zeros((2, 2)))[3].tolist() == [False, True]
    with pytest.raises(gymnasium.error.ResetNeeded, match="robot 1: its episode ended"):
        env.step(np.zeros((2, 2)))
    env.reset(options={"reset_mask": np.array([False, True])})
    assert env.step(np.zeros((2, 2)))[3].tolist() == [True, False]


def test_an_episode_begins_where_options_say(tee: BuiltMine):
    env, vector = MineEnv(tee.bundle), MineVectorEnv(2, tee.bundle)
    _, info = env.reset(seed=0, options={"pose": (20.0, 2.5, 1.0)})
    np.testing.assert_allclose(info["pose_m_rad"], [20.0, 2.5, 1.0], atol=1e-9)
    _, many = vector.reset(seed=0, options={"pose": (20.0, 2.5, 1.0)})
    np.testing.assert_allclose(many["pose_m_rad"], [[20.0, 2.5, 1.0]] * 2, atol=1e-9)
    station, place = next(iter(json.loads(env.world.read(TOPOLOGY))["nodes_m"].items()))
    for one in (env, vector):
        _, info = one.reset(seed=0, options={"station": station})
        np.testing.assert_allclose(np.atleast_2d(info["pose_m_rad"])[0, :2], place[:2], atol=1e-9)
    _, infos = MineParallelEnv(2, world=tee.bundle).reset(seed=0, options={"station": station})
    np.testing.assert_allclose(infos["robot_0"]["pose_m_rad"][:2], place[:2], atol=1e-9)
    world = env.world
    row, column = np.unravel_index(world.clearance_m.argmax(), world.clearance_m.shape)
    _, info = env.reset(seed=0, options={"cell": (row, column)})
    place = world.origin_m + (np.array([column, row]) + 0.5) * world.cell_m
    np.testing.assert_allclose(info["pose_m_rad"][:2], place, atol=1e-9)


@pytest.mark.parametrize("many", [None, MineVectorEnv, MineParallelEnv])
def test_a_seed_of_noise_changes_the_noise_and_not_the_place(tee: BuiltMine, many):
    made = partial(MineEnv, tee.bundle) if many is None else partial(many, 2, world=tee.bundle)
    env = made(conditions="dusty")
    row = "robot_1" if many is MineParallelEnv else slice(None)
    pose = (lambda info: info[row]["pose_m_rad"]) if many is MineParallelEnv else (lambda info: info["pose_m_rad"])
    first, info = env.reset(seed=0)
    for noise in (7, 8):
        one, own = env.reset(seed=0, options={"noise_seed": noise})
        two, _ = env.reset(seed=0, options={"noise_seed": noise})
        np.testing.assert_array_equal(one[row], two[row])
        np.testing.assert_array_equal(pose(own), pose(info))
        assert (one[row] != first[row]).any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pose": (1.0, 2.0)}, "options: pose = .*: want x, y, yaw, m and rad, mine frame"),
        ({"pose": (1e6, 0.0, 0.0)}, "options: pose = .* 0.00 m from rock; the robot needs 0.35 m"),
        ({"cell": (0.5, 1)}, "options: cell = .*: want whole numbers below"),
        ({"station": "nowhere"}, "options: station = 'nowhere': want one of "),
        ({"noise_seed": -1}, "options: noise_seed = -1: want a whole number of 0 or more"),
        ({"where": 1}, "options: unknown 'where'; there are: .*pose, cell, station, noise_seed"),
        ({"goal": (1.0, 2.0)}, "options: unknown 'goal'; there are: .*pose, cell, station, noise_seed"),
        ([1], "options = .*: want a dict"),
        ({"cell": (1, 1), "station": "J00"}, "options: cell and station: want one of pose, cell, station"),
    ],
)
def test_a_start_that_is_none_is_refused_in_one_line(tee: BuiltMine, options, message):
    for env in (MineEnv(tee.bundle), MineVectorEnv(2, tee.bundle), MineParallelEnv(2, world=tee.bundle)):
        with pytest.raises(ValueError, match=message):
            env.reset(options=options)


def test_calls_of_a_vector_give_pictures_or_an_attribute_a_robot(tee: BuiltMine):
    env = MineVectorEnv(2, tee.bundle)
    env.reset(seed=0)
    assert env.call("render_mode") == (None, None)
    assert env.call("render") == (None, None)
    with pytest.raises(ValueError, match="call: 'reset': robots have no methods of their own"):
        env.call("reset")
    env.close()
