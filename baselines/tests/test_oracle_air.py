"""The bound of robots that fly: the network in plan in a level mine, and storeys, shafts and spirals in a volume."""

import dataclasses

import numpy as np
import pytest

from baselines.oracle.air import fastest_in_plan_mps, free_columns, network_in_air
from baselines.oracle.air_views import cubes_in_view
from baselines.oracle.bound import best_walk
from baselines.oracle.network import time_network
from baselines.oracle.problem import CoverageProblem, SquareGrid
from baselines.policies.policy_lookup import make_policy
from baselines.running.protocol import run_episodes
from minexplore.envs.vector import MineVectorEnv
from minexplore.sensing.cubes import CubeGrid
from minexplore.task import TaskParams
from tests.heights import HEADER, shelves, spiral, table
from tests.volumes import build_volume

# A drift, a shaft of 4 m by 4 m at its end, and a drift 30 m lower, of 60 m.
STOREYS = HEADER + (
    "A,1,0,0,2,2,30,3,0\nA,2,40,0,2,2,30,3,0\nB,2,40,0,2,2,30,3,0\nB,3,40,0,2,2,0,3,0\n"
    "C,3,40,0,2,2,0,3,0\nC,4,-20,0,2,2,0,3,0\n"
)
STATIONS = np.array([place for _, *place in spiral(2)["D"]])


def flyer(world, **task):
    return MineVectorEnv(1, world=world, robot="quadrotor", task=TaskParams(terrain=False, tilt=False, **task))


@pytest.fixture(scope="module")
def decline(tmp_path_factory):
    """Return a spiral of two turns, whose drift is twice over or under itself."""
    return build_volume(table(spiral(2)), tmp_path_factory.mktemp("decline"))


@pytest.fixture(scope="module")
def storeys(tmp_path_factory):
    return build_volume(STOREYS, tmp_path_factory.mktemp("storeys"))


class AlongLine:
    """Flies at full speed along places (n, 3) m, by its true pose."""

    def __init__(self, places):
        along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1)))
        at = np.arange(0.0, along[-1], 0.5)
        self._line = np.column_stack([np.interp(at, along, places[:, axis]) for axis in range(3)])

    def reset(self, robots, seeds):
        pass

    def act(self, observation, info):
        x, y, yaw = info["pose_m_rad"][0]
        place = np.array([x, y, info["height_m"][0]])
        nearest = int(np.linalg.norm(self._line - place, axis=1).argmin())
        way = self._line[min(nearest + 4, len(self._line) - 1)] - place
        ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
        level = way[:2] / max(np.linalg.norm(way[:2]), 1.0)
        return np.array([[level @ ahead, level @ left, np.clip(way[2], -1.0, 1.0), 1.0]])


def require_below(env, network, policy, horizon_s):
    """Fly a policy; return the shares that it and the bound have of all cubes, at 0, 2, ... s."""
    (episode,) = run_episodes(env, policy, [0])
    bounds = np.array([best_walk(network, t).most for t in np.arange(0.0, horizon_s, 4.0)])
    seen = np.array(episode.seen)[: 2 * len(bounds)]
    assert (seen <= np.repeat(bounds, 2)[: len(seen)]).all()  # samples lie 2 s apart, bands 4 s
    return seen / env.robots.grid.total, bounds / env.robots.grid.total


def test_a_robot_that_turns_flies_faster_than_commanded_and_no_faster_than_the_bound_takes(box):
    env = flyer(box)
    batch, rngs = env.robots, [np.random.default_rng(0)]
    batch.reset(np.arange(1), rngs)
    batch.place(0, 2.0, 0.0, 0.0)
    east = []
    for _ in range(80):  # the push at a right angle is at its side: it aims so much to the other one
        aim = np.arctan2(env.task.max_turn_radps, batch.robot.velocity_gain_ps) + batch.poses()[0][2]
        batch.step(np.array([[np.cos(aim), -np.sin(aim), 0.0, 1.0]]), rngs)
        east.append(batch.poses()[0][0])
    assert not batch.collisions[0]
    fastest = (east[60] - east[40]) / 2.0
    assert 1.2 * env.task.max_forward_mps < fastest < fastest_in_plan_mps(batch)
    assert fastest > 0.95 * fastest_in_plan_mps(batch)
    env.close()


def test_the_network_of_a_level_mine_is_that_in_plan_with_all_cubes_over_places_in_view(tee):
    env = flyer(tee.bundle)
    batch, cubes = env.robots, env.robots.grid
    task = dataclasses.replace(env.task, max_forward_mps=fastest_in_plan_mps(batch) / 1.02)  # its margin
    plan = SquareGrid(cubes.in_plan(cubes.reachable), cubes.origin_m, cubes.cell_m)
    wanted = time_network(CoverageProblem(env.world, task, batch.robot, plan), 4.0)
    found = network_in_air(batch, 4.0)
    assert (list(found.graph), found.root) == (list(wanted.graph), wanted.root)
    assert sorted(found.graph.edges) == sorted(wanted.graph.edges)
    np.testing.assert_allclose(found.arrival_s, wanted.arrival_s[wanted.standing], rtol=1e-12)
    for node, cells in wanted.credit.items():
        over = np.unravel_index(cells, plan.reachable.shape)
        seen = np.zeros(cubes.total, bool)
        seen[found.credit[node]] = True
        np.testing.assert_array_equal(np.argwhere(cubes.in_plan(seen)), np.column_stack(over))
        columns = cubes.cubes[:, :2] - cubes.low[:2]
        assert (cubes.in_plan(seen)[columns[:, 1], columns[:, 0]] == seen).all()  # each column as a whole
    env.close()


def test_a_climb_takes_no_time_and_the_drift_over_another_no_short_cut(storeys):
    env = flyer(storeys)
    free, _ = free_columns(env.world, 0.16)
    network = network_in_air(env.robots, 4.0)
    start, speed = env.robots.ground.start_m, fastest_in_plan_mps(env.robots)
    assert start[2] < 5.0  # it begins in the lower drift
    shaft_m = free.places_m[free.headroom_m > 30.0, 0].min()  # its near side
    for x, z in ((20.0, 0.0), (20.0, 30.0), (5.0, 30.0)):
        column = np.floor((np.array([x, 0.1]) - free.origin_m) / free.cell_m)
        here = (free.column == column[0]) & (free.row == column[1]) & (np.abs(free.floor_m - z) < 0.5)
        way = abs(x - start[0]) if z < 1 else 2 * shaft_m - start[0] - x
        assert network.arrival_s[here] == pytest.approx([way / speed], rel=0.03)
    env.close()


def test_beams_pass_up_a_shaft_and_not_through_the_rock_between_storeys(storeys):
    env = flyer(storeys)
    free, _ = free_columns(env.world, 0.16)
    for x, upper, lower in ((20.0, True, False), (40.0, True, True)):
        (number,) = np.flatnonzero(
            (np.hypot(*(free.places_m - (x + 0.1, 0.1)).T) < 0.1) & (free.floor_m + free.headroom_m > 32)
        )
        seen = cubes_in_view(free, 10.0, env.robots.grid, np.array([number]), np.ones(1, int))[1]
        heights = env.robots.grid.cubes[seen, 2] * 2.0
        assert ((heights >= 28).any(), (heights < 4).any()) == (upper, lower)
    env.close()


def test_a_spiral_takes_as_long_as_it_is_and_a_flight_down_it_at_full_speed_stays_below_the_bound(decline):
    env = flyer(decline, max_steps=1500)
    network = network_in_air(env.robots, 4.0)
    places = STATIONS - [0.0, 0.0, env.world.record["volume"]["datum_m"]] + [0.0, 0.0, 1.2]
    flown, bound = require_below(env, network, AlongLine(places), 150.0)
    print(np.column_stack([np.arange(len(flown)) * 2, flown, np.repeat(bound, 2)[: len(flown)]])[::5])
    assert flown[-1] > 0.95
    assert 0.5 < flown[30] < bound[15] < 0.8  # at 60 s
    assert np.isfinite(network.arrival_s).all()
    around = 2 * 2 * np.pi * (14.0 - 2.2)  # two turns along the inner wall
    assert network.arrival_s.max() > (around + 40.0) / fastest_in_plan_mps(env.robots) / 1.05
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("mine", ["decline", "storeys", "cave"])
def test_no_explorer_that_flies_beats_the_bound(mine, request, tmp_path):
    world = build_volume(table(shelves()), tmp_path) if mine == "cave" else request.getfixturevalue(mine)
    env = flyer(world, max_steps=1200)
    network = network_in_air(env.robots, 4.0)
    policy = make_policy("nearest-frontier", 1, env.task, env.robot, env.world.has_heights)
    seen, bound = require_below(env, network, policy, 120.0)
    print(mine, np.column_stack([np.arange(len(seen)) * 2, seen, np.repeat(bound, 2)[: len(seen)]])[::5])
    assert seen[-1] > 2 * seen[0]
    assert bound[0] < 0.4
    assert bound[5] < bound[-1]
    env.close()


def test_cubes_between_heights_are_those_whose_place_and_height_are_asked_for():
    grid = CubeGrid(np.array([[x, y, z] for x in (1, 3) for y in (1, 3) for z in (1, 3, 7)]), 2.0)
    found = grid.between(
        np.array([[1.0, 1.0], [3.5, 3.0], [9.0, 1.0]]), np.array([3.9, -5.0, 0.0]), np.array([6.5, 0.5, 9.0])
    )
    assert grid.cubes[found].tolist() == [[0, 0, 1], [0, 0, 3], [1, 1, 0]]
    assert not grid.between(np.array([[1.0, 1.0]]), np.array([8.0]), np.array([99.0])).any()
