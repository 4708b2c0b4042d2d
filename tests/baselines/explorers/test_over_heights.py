"""Explorers and coverage over the sheets of mines with heights."""

import numpy as np
import pytest

from baselines.base.errors import BaselineError
from baselines.explorers import EXPLORERS, Explorer
from baselines.explorers.maps.layers import LayeredMap, Stance
from baselines.explorers.maps.own_map import FREE, ROCK, UNKNOWN
from baselines.explorers.reactive import Reactive
from baselines.oracle.__main__ import require_no_folds
from baselines.policies.found import make_policy
from baselines.running.protocol import run_episodes
from baselines.sandbox.confined import Confined, ConfinedPolicy
from minexplore.envs.vector import MineVectorEnv
from minexplore.sensing.coverage import CoverageGrid
from minexplore.task import TaskParams
from minexplore.world import load_world
from tests.heights import UNDER, MineWithHeights, spiral

LEVEL = np.eye(3)[:2]
BEARINGS = np.radians([0.0, 90.0, 180.0, 270.0])
SENSOR_M, FAR_M = 0.5, 10.0
DRY = {"terrain": False}  # mud and water on a decline of 13 % are slippery: robots slide there


@pytest.fixture(scope="module")
def under(mine_of_legs):
    return mine_of_legs(UNDER, "preset=light")


def seen_by_sheet(env):
    """Return the share of each sheet's reachable cells that each robot has seen, (robots, sheets)."""
    grid = env.robots.grid
    row, col = np.nonzero(grid.reachable)
    sheet = env.world.floor.sheets_at(grid.origin_m + (np.column_stack([col, row]) + 0.5) * grid.cell_m)
    sheets = range(len(env.world.floor.offset_m))
    return np.array([[seen[row, col][sheet == k].mean() for k in sheets] for seen in env.robots.seen])


def explore(world, name, steps):
    env = MineVectorEnv(1, world=world, task={"max_steps": steps, **DRY})
    (episode,) = run_episodes(env, make_policy(name, 1, env.task, env.robot, heights=True), [0])
    shares = seen_by_sheet(env)[0]
    env.close()
    return episode, shares


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


@pytest.mark.parametrize(
    ("name", "steps"),
    [
        ("depth-first", 2000),
        pytest.param("nearest-frontier", 4000, marks=pytest.mark.slow),
        pytest.param("two-level", 4000, marks=pytest.mark.slow),
    ],
)
def test_an_explorer_drives_over_a_seam_and_sees_all_sheets(name, steps, under):
    episode, shares = explore(under.bundle, name, steps)
    assert len(shares) == 2
    assert (shares > 0.9).all(), shares
    assert episode.collided == 0


def test_one_table_has_each_explorer_for_level_mines_and_for_mines_with_heights(monkeypatch):
    monkeypatch.setitem(EXPLORERS, "mapless", Explorer(Reactive))
    for heights, mapped in ((False, "FrontierTour"), (True, "FrontierTourOverHeights")):
        kinds = [type(make_policy(name, 1, TaskParams(), heights=heights)) for name in ("mapless", "frontier-tour")]
        assert [kind.__name__ for kind in kinds] == ["Reactive", mapped]


@pytest.mark.slow
@pytest.mark.parametrize("name", [*EXPLORERS][2:])
@pytest.mark.parametrize(("legs", "sheets"), [(spiral(3), 4)])
def test_explorers_reach_all_sheets_of_a_spiral(name, legs, sheets, light, tmp_path):
    mine = MineWithHeights(legs, light, tmp_path)
    _, shares = explore(mine.bundle, name, 12_000)
    assert len(shares) == sheets
    assert (shares > 0.8).all(), shares


def test_a_learned_policy_refuses_a_mine_with_heights():
    with pytest.raises(BaselineError, match="learned policies map level mines only"):
        make_policy("x.safetensors", 1, None, None, heights=True)


def test_a_confined_policy_is_told_heights_and_attitudes(under, tmp_path, monkeypatch):
    (tmp_path / "strange.py").write_text(
        "from baselines.explorers.over_heights import DepthFirstOverHeights\n\n\n"
        "class Strange(DepthFirstOverHeights):\n    pass\n"
    )
    monkeypatch.chdir(tmp_path)
    env = MineVectorEnv(1, world=under.bundle, task=DRY)
    observation, info = env.reset(seed=[3])
    here = make_policy("depth-first", 1, env.task, env.robot, heights=True)
    with ConfinedPolicy("strange:Strange", 1, env.task, env.robot, Confined(), heights=True) as there:
        for policy in (here, there):
            policy.reset(np.arange(1), np.array([3]))
        for _ in range(5):
            actions = [np.asarray(policy.act(observation, info)) for policy in (here, there)]
            np.testing.assert_array_equal(*actions)
            observation, _, _, _, info = env.step(actions[0])
    env.close()


def test_no_bound_is_computed_over_a_folded_plan(under):
    with pytest.raises(BaselineError, match="a/mine: its floors are a folded plan"):
        require_no_folds("a/mine", load_world(under.bundle))


def test_robots_start_on_any_sheet_and_coverage_counts_all(under):
    env = MineVectorEnv(2, world=under.bundle, task=DRY)
    env.reset(seed=[0, 1])
    (seam,) = env.world.floor.seams()
    for robot, middle in enumerate(seam):
        away = under.floor.vertices[under.floor.faces[under.floor.sheet == robot]].mean(axis=1)[:, :2]
        place = away[np.linalg.norm(away - middle, axis=1).argmax()]
        env.robots.place(robot, *place, 0.0)
        assert env.world.floor.sheets_at(env.robots.plan_places(np.array([robot])))[0] == robot
    for _ in range(3):
        info = env.step(np.zeros((2, 2)))[4]
    shares = seen_by_sheet(env)
    assert shares[1, 1] > 0.05
    assert info["cells_reachable"][0] > 0.9 * under.free_space.polygon.area / 4
    near = CoverageGrid(env.world, 2.0, 0.35, seam[0], 15.0)
    row, col = np.nonzero(near.reachable)
    sheets = env.world.floor.sheets_at(near.origin_m + (np.column_stack([col, row]) + 0.5) * 2.0)
    assert set(sheets.tolist()) == {0, 1}  # a region round a seam reaches into both
    env.close()
