import dataclasses

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from baselines.base.environments import make_env
from baselines.base.speed import top_speed_mps
from baselines.oracle import __main__ as oracle
from baselines.oracle.bound import best_walk
from baselines.oracle.network import TimeNetwork, time_network
from baselines.oracle.problem import CoverageProblem
from baselines.oracle.tour import OracleTour, plan_tour
from baselines.policies.policy_lookup import make_policy
from baselines.running.protocol import run_episodes
from baselines.scoring.bounds import read_bounds, write_bound

TEE_LONGEST_M = 85.0  # from any place of the tee to any other, round its corner


def network_of(edges, credit, root=0):
    graph = nx.MultiGraph(edges)
    cells = {node: np.array(sorted(credit.get(node, [])), dtype=int) for node in graph}
    return TimeNetwork(graph, root, 1.0, cells, {}, np.zeros((0, 0)), np.zeros((0, 0)))


def best_by_hand(network, passages):
    """Return the most cells that a walk of so many passages sees, by trying all walks."""
    best, reached = 0, {(network.root, frozenset([network.root]))}
    for _ in range(passages + 1):
        best = max(best, *(len(set().union(*(network.credit[n].tolist() for n in seen))) for _, seen in reached))
        reached = {(v, seen | {v}) for u, seen in reached for v in network.graph[u]} | reached
    return best


def test_a_branch_that_is_left_again_costs_its_length_twice():
    edges = [(0, 1), (1, 2), (0, 3), (3, 4)]
    network = network_of(edges, {0: [0], 1: [1], 2: [2, 3], 3: [4], 4: [5]})
    assert [best_walk(network, s).most for s in range(7)] == [1, 2, 4, 4, 5, 5, 6]


@given(st.data())
@settings(max_examples=40, deadline=None)
def test_the_best_walk_is_that_of_trying_all(data):
    size = data.draw(st.integers(2, 7))
    edges = [(data.draw(st.integers(0, i - 1)), i) for i in range(1, size)]
    for _ in range(data.draw(st.integers(0, 2))):  # loops
        u, v = data.draw(st.integers(0, size - 1)), data.draw(st.integers(0, size - 1))
        if u != v:
            edges.append((u, v))
    credit = {i: data.draw(st.lists(st.integers(0, 12), max_size=4)) for i in range(size)}
    network = network_of(edges, credit)
    passages = data.draw(st.integers(0, 8))
    walk = best_walk(network, passages)
    assert walk.most == walk.found == best_by_hand(network, passages)
    used = nx.MultiDiGraph(walk.passages)
    assert not walk.passages or nx.has_eulerian_path(used, network.root)


def test_no_explorer_beats_the_bound_and_the_tour_comes_near(tee_id):
    env = make_env(tee_id, 1)
    network = time_network(CoverageProblem.of(env.robots), 2.0)
    horizon = env.task.max_steps * env.task.control_s
    walks = {t: best_walk(network, t) for t in np.linspace(0, horizon, 3)}
    bounds = {t: walk.most for t, walk in walks.items()}
    tour = OracleTour(1, env.task, env.robot, plan_tour(network, walks[horizon], env.world))
    reached = []
    for policy in (tour, make_policy("information-gain", 1, env.task)):
        (episode,) = run_episodes(env, policy, [0])
        reached.append(episode.seen[-1])
        for t, most in bounds.items():  # samples lie 2 s apart
            sample = min(int(t / 2), len(episode.seen) - 1)
            assert episode.seen[sample] <= most
    assert reached[0] >= 0.85 * bounds[horizon]
    env.close()


@pytest.mark.slow
def test_a_begun_bound_is_completed_and_a_current_one_is_kept(tee_id, tmp_path, monkeypatch):
    monkeypatch.setattr("baselines.scoring.bounds.BOUNDS", tmp_path / "bounds.json")
    monkeypatch.setattr("baselines.base.result_file.RESULTS", tmp_path)
    asked = []
    monkeypatch.setattr(oracle, "best_walk", lambda *args: asked.append(args[1]) or best_walk(*args))
    oracle.renew(tee_id, [0], 5.0, tmp_path / "oracle.png")
    whole = read_bounds()[tee_id]
    assert asked == [*whole.time_s, *(budget * whole.time_s[-1] for budget in oracle._BUDGETS)]
    asked.clear()
    oracle.renew(tee_id, [0], 5.0, tmp_path / "oracle.png")
    assert asked == []
    write_bound(tee_id, whole.model_copy(update={"time_s": whole.time_s[:4], "most": whole.most[:4]}))
    oracle.renew(tee_id, [0], 5.0, tmp_path / "oracle.png")
    assert asked == whole.time_s[4:]
    assert read_bounds()[tee_id] == whole
    asked.clear()
    write_bound(tee_id, whole.model_copy(update={"inputs_sha256": "0" * 64}))  # of another world or task
    oracle.renew(tee_id, [0], 5.0, tmp_path / "oracle.png")
    assert asked == whole.time_s
    assert read_bounds()[tee_id] == whole


def test_a_straight_drift_is_a_path_of_bands(tee_id):
    env = make_env(tee_id, 1)
    network = time_network(CoverageProblem.of(env.robots), 2.0)
    graph = nx.Graph(network.graph)
    assert nx.is_forest(graph.subgraph(nx.node_connected_component(graph, network.root)))
    ends = [n for n in graph if graph.degree(n) == 1 and n != network.root]
    assert 2 <= len(ends) <= 4  # the tee's three ends, one of which may be where it begins
    world, spawn = env.world, network.places[network.root]
    row, col = np.nonzero(np.isfinite(network.arrival_s))
    places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
    speed = top_speed_mps(world, env.task, places[:, 0])
    least = np.linalg.norm(places - spawn, axis=1) / speed.max()
    found = network.arrival_s[row, col]
    assert (found <= 1.05 * TEE_LONGEST_M / 1.5).all()
    assert (found >= (least - world.cell_m) / 1.014).all()  # nobody comes faster than straight
    here = world.zones_at(places[:, 0]) == world.zones_at(np.array([spawn[0]]))
    inline = (np.abs(places - spawn).min(axis=1) < 0.2) & here  # along and across the drift the straight way is open
    assert inline.sum() > 50
    straight = np.linalg.norm(places - spawn, axis=1)[inline] / speed[inline]
    np.testing.assert_allclose(found[inline], straight, atol=0.02 * straight.max() + world.cell_m)


def test_water_under_a_dip_lets_a_robot_slide_a_tenth_faster_than_commanded(tee_id):
    env = make_env(tee_id, 1)
    level = dataclasses.replace(env.task, tilt=False)
    east = np.array([(g.west_m + g.east_m) / 2 for g in env.world.floor_zones])
    np.testing.assert_allclose(top_speed_mps(env.world, level, east) / top_speed_mps(env.world, level, east)[0], 1.0)
    faster = top_speed_mps(env.world, env.task, east) / top_speed_mps(env.world, level, east)
    assert faster.tolist() == pytest.approx([1.0, 1.04 / 1.02, 1.12 / 1.02])
    env.close()
