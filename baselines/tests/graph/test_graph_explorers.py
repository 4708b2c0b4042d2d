import itertools

import numpy as np
import pytest

from baselines.explorers.graph_explorer import Driver
from baselines.explorers.ground import LevelGround
from baselines.explorers.maps.map_graph import map_graph, worth_driving_to
from baselines.explorers.maps.own_map import FINE, FREE, ROCK, OwnMap
from baselines.explorers.tour import open_tour
from baselines.policies.policy_lookup import make_policy
from baselines.running.protocol import run_episodes
from minexplore.envs.vector import MineVectorEnv
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams

CELL_M = 2.0


def map_of(plan):
    """Return a map whose coverage cells are given by characters: # rock, . free and seen, ? unknown, north first."""
    own = OwnMap(CELL_M)
    rows = plan.split()[::-1]
    own.seen = np.array([[c == "." for c in row] for row in rows])
    kinds = {"#": ROCK, ".": FREE, "?": 0}
    own.fine = np.repeat(np.repeat(np.array([[kinds[c] for c in row] for row in rows], np.uint8), FINE, 0), FINE, 1)
    return own


def graph_of(plan):
    own = map_of(plan)
    return map_graph(own, 0.35, np.ones_like(own.seen))


PILLAR = "########## #........# #.######.# #.######.# #.######.# #........# ##########"


def test_links_do_not_lead_through_rock_and_paths_go_round_it():
    graph = graph_of(PILLAR)
    west, east = (graph.nearest(np.array(place)) for place in ((3.0, 7.0), (17.0, 7.0)))
    costs, before = graph.costs_from([west])
    assert costs[0, east] > 16  # across the pillar it would be 14 m
    path = graph.path(np.array([3.2, 7.1]), before[0], east)
    assert path[0].tolist() == [3.2, 7.1]
    column, row = np.floor(path / CELL_M).astype(int).T
    rock = np.array([[character == "#" for character in line] for line in PILLAR.split()[::-1]])
    assert not rock[row, column].any()
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() <= 0.41


def test_a_robot_starts_from_a_node_on_its_own_side_of_a_wall():
    own = map_of("############ #....#.....# #....#.....# #....#.....# ############")
    wall = slice(5 * FINE, 6 * FINE)
    own.fine[FINE:-FINE, wall] = FREE
    own.fine[FINE:-FINE, wall.start + 2] = ROCK  # 0.4 m thick; the cells at both sides of it are narrow
    graph = map_graph(own, 0.35, np.ones_like(own.seen))
    for x, west in ((10.7, True), (11.3, False)):
        node = graph.nearest(np.array([x, 5.0]))
        assert (graph.places[node, 0] < 11.0) == west
    costs, _ = graph.costs_from([graph.nearest(np.array([10.7, 5.0]))])
    assert not np.isfinite(costs[0, graph.nearest(np.array([11.3, 5.0]))])


def test_a_path_leads_round_the_corner_that_a_robot_stands_at_and_not_back():
    graph = graph_of("########## #........# #.######## #.######## #.######## ##########")
    place = np.array([3.3, 6.4])
    _, before = graph.costs_from([graph.nearest(place)])
    path = graph.path(place, before[0], graph.nearest(np.array([17.0, 9.0])))
    assert (np.diff(path[:, 1]) > -1e-9).all()
    assert (np.diff(path[:, 0])[path[1:, 1] > 8.0] > -1e-9).all()


def test_a_place_on_passed_ground_goes_before_a_wider_one_on_unknown_ground():
    own = map_of("##### #...# #...# #...# #####")
    own.fine[FINE:-FINE, 2 * FINE : 3 * FINE] = 0
    own.fine[FINE:-FINE, 2 * FINE] = FREE  # at the cell's border: the middle of the drift is wider
    graph = map_graph(own, 0.35, np.ones_like(own.seen))
    middle = graph.cells[:, 0] == 2
    assert middle.any()
    np.testing.assert_allclose(graph.places[middle, 0], 4.2)


def test_the_frontier_is_in_clusters_that_are_no_longer_than_a_block():
    graph = graph_of("############# #...........? #...........? ############# #############")
    assert set(graph.cells[graph.cluster > 0][:, 0]) == {12}
    assert graph.cluster.max() == 1
    long = graph_of("?????????????? .............. .............. ##############")
    assert long.cluster.max() >= 3
    for number in range(1, long.cluster.max() + 1):
        assert np.ptp(long.cells[long.cluster == number], axis=0).max() < 4


def test_cells_out_of_the_region_and_cells_given_up_are_not_driven_to():
    own = map_of("....... ....... .......")
    keep = worth_driving_to(own, [(1, 1)], np.array([1.0, 1.0]), 8.0)
    assert not keep[1, 1]
    assert keep[0, :4].all()
    assert not keep[:, 5:].any()


def test_an_open_tour_is_as_short_as_the_shortest_of_all_orders():
    for seed in range(20):
        places = np.random.default_rng(seed).uniform(0, 50, (6, 2))
        costs = np.linalg.norm(places[:, None] - places, axis=2)

        def length(order, costs=costs):
            return sum(costs[a, b] for a, b in itertools.pairwise([0, *(stop + 1 for stop in order)]))

        best = min(length(order) for order in itertools.permutations(range(5)))
        assert length(open_tour(costs)) <= 1.1 * best
        ending = min(length((*order, 2)) for order in itertools.permutations([0, 1, 3, 4]))
        tour = open_tour(costs, last=2)
        assert tour[-1] == 2
        assert sorted(tour) == [0, 1, 2, 3, 4]
        assert length(tour) <= 1.1 * ending


@pytest.mark.slow
@pytest.mark.parametrize("name", ["frontier-tour", "depth-first", "two-level"])
def test_an_explorer_of_the_graph_sees_a_small_mine_and_touches_nothing(tee, name):
    env = MineVectorEnv(1, world=tee.bundle, task={"max_steps": 2000})
    (episode,) = run_episodes(env, make_policy(name, 1, env.task), [0])
    assert episode.seen[-1] / env.robots.grid.total >= 0.9
    assert episode.collided == 0
    env.close()


def test_a_goal_that_a_robot_cannot_get_to_is_given_up():
    task, place = TaskParams(), np.array([3.0, 3.0])
    driver = Driver(LevelGround(task, RobotParams(), 1), task.region_m)
    driver.ground.map = map_of("############# #...........? #...........? ############# #############")
    goals = set()
    for _ in range(500):
        if driver.wants_a_plan(place):
            situation = driver.look_around(place)
            if situation is None:
                break
            driver.head_for(situation, int(situation.costs.argmin()))
            goals.add(driver.goal)
    assert situation is None
    assert goals == {(12, 2), (12, 3)}
