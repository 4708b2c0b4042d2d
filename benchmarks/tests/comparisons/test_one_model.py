"""A level plan by both models: one space, by code that neither of them uses, which is held against known answers."""

import dataclasses

import numpy as np
import pytest
import shapely

from baselines.oracle.air import network_in_air
from baselines.oracle.bound import best_walk
from benchmarks.comparisons.one_model.agreement import certificate_of, compare
from benchmarks.comparisons.one_model.measures import Beams, enclosed_area, push, reach_by_outline
from benchmarks.comparisons.one_model.twins import PLANS, TracedPlan, Twins
from benchmarks.worlds.small_world import WORKINGS
from minexplore.envs.vector import MineVectorEnv
from tests.project import ROOT

ROOM = shapely.box(0, 0, 10, 4)
BOX = [
    np.array([(x, y, z) for x in xs for y in ys for z in (-1.0, 4.0)])
    for xs, ys in (((-1, 0), (-1, 5)), ((10, 11), (-1, 5)), ((-1, 11), (-1, 0)), ((-1, 11), (4, 5)))
]
BOX += [np.array([(x, y, z) for x in (-1, 11) for y in (-1, 5) for z in zs]) for zs in ((-1, 0), (3, 4))]


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Return a ring of drifts with a dead end by both models."""
    return Twins(TracedPlan.drawn("small", WORKINGS, (2.0, 2.0)), tmp_path_factory.mktemp("twins"))


@pytest.fixture(scope="module")
def compared(small):
    return compare(small, 5000, 300, np.random.default_rng(0))


def test_both_models_of_a_small_plan_are_the_same_space(compared):
    assert compared.holds, compared
    assert compared.touch[0] > 50
    assert compared.touch[1] == pytest.approx(compared.touch[0], rel=0.1)


def test_a_robot_reaches_the_same_area_in_both_models(compared):
    by_outline, on_grid, on_spans = compared.reach_m2
    cells_m2 = 0.25 * WORKINGS.length  # a row of cells along all walls
    assert on_grid == pytest.approx(by_outline, abs=cells_m2)
    assert on_spans == pytest.approx(by_outline, abs=cells_m2)


def test_the_volume_of_a_small_plan_has_no_more_parts_and_its_certificate_holds(small, compared):
    assert compared.parts[1] <= compared.parts[0]
    assert certificate_of(small)


def test_the_bound_of_a_robot_that_flies_is_nearly_the_same_in_both_models(small):
    most = []
    for model in (small.level, small.volume):
        env = MineVectorEnv(1, world=model.folder, robot="quadrotor", task={"terrain": False})
        network, total = network_in_air(env.robots, 2.0), env.robots.grid.total
        most.append([best_walk(network, seconds).most for seconds in range(0, 24, 4)])
        env.close()
        assert most[-1][0] < 0.8 * total < most[-1][-1] == total
    np.testing.assert_allclose(*most, rtol=0, atol=4)  # of 196 cubes; why the slab has 4 less at 4 s was not found


def test_a_wall_that_is_moved_by_a_millimetre_is_found(small):
    volume = small.volume
    walls = [k for k, label in enumerate(volume.label.tolist()) if label == 1]
    moved = [corners + (0.001 if k == walls[0] else 0.0) for k, corners in enumerate(volume.corners)]
    twins = Twins(small.plan, small.folder)
    vars(twins).update(level=small.level, volume=dataclasses.replace(volume, corners=moved), _rock=small._rock)
    assert not compare(twins, 5000, 100, np.random.default_rng(0)).holds


def test_beams_in_a_box_have_its_ranges_by_its_outline_and_by_its_parts():
    places = np.array([(5.0, 2.0, 1.0)] * 5)
    ways = np.array([(1.0, 0, 0), (0, -1.0, 0), (0, 0, 1.0), (0, 0, -1.0), (0.6, 0, 0.8)])
    beams = Beams(places, ways)
    wanted = pytest.approx([5.0, 2.0, 2.0, 1.0, 2.5])
    assert beams.in_slab(ROOM, 3.0) == wanted
    assert beams.among(BOX) == wanted


def test_parts_enclose_the_room_between_them_and_a_disc_reaches_what_is_a_radius_from_walls():
    assert enclosed_area(BOX, 1.5, (5.0, 2.0)).equals(ROOM)
    assert reach_by_outline(ROOM, (5.0, 2.0)) == pytest.approx(9.3 * 3.3)


def test_a_disc_that_is_pushed_to_a_wall_ends_a_radius_from_it():
    found = push(BOX, np.array([(2.0, 2.0), (5.0, 2.0)]), np.array([np.pi, np.pi / 2]))
    assert found.ends_m == pytest.approx(np.array([(0.35, 2.0), (5.0, 3.65)]), abs=0.01)
    assert found.touch.all()
    assert 0 < found.deepest_mm(ROOM) < 10


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(PLANS)))
def test_both_models_of_the_default_and_of_generated_plans_are_the_same_space(number, tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    twins = Twins(PLANS[number](), tmp_path)
    found = compare(twins, 20_000, 2_000, np.random.default_rng(number))
    assert found.holds, found
    assert len(twins.volume.corners) <= 1.35 * len(twins.level.corners)
    assert certificate_of(twins)
