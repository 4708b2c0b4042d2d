"""The bound and the tour over the floors of a volume."""

import numpy as np
import pytest

from baselines.base.errors import BaselineError
from baselines.oracle.bound import Walk, best_walk
from baselines.oracle.problem import CoverageProblem
from baselines.oracle.span_views import free_heights
from baselines.oracle.spans import network_over_spans, slowness, span_links, spans_of, tour_over_spans
from baselines.oracle.tour import OracleTour
from baselines.policies.policy_lookup import make_policy
from baselines.running.protocol import run_episodes
from minexplore.envs.vector import MineVectorEnv
from minexplore.world import load_world
from tests.volumes import HEADER, build_volume

DRY = {"terrain": False}
# Two drifts 12 m over each other, and a shaft with vertical walls between their ends.
PIT = HEADER + (
    "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,0,3,0\n"
    "B,2,20,0,2,2,0,3,0\nB,3,20,0,2,2,-12,3,0\nC,3,20,0,2,2,-12,3,0\nC,4,40,0,2,2,-12,3,0\n"
)


def test_the_least_time_along_a_drift_is_its_length_at_the_commanded_speed(box):
    env = MineVectorEnv(1, world=box, task=DRY)
    network, spans = network_over_spans(CoverageProblem.of(env.robots), 2.0), spans_of(env.world)
    start = int(network.places[network.root][0])
    along = np.abs(spans.places_m[:, 0] - spans.places_m[start, 0])
    far = network.standing & (np.abs(spans.places_m[:, 1] - spans.places_m[start, 1]) < 0.01) & (along > 5)
    speed = 1 / slowness(env.world, env.task)[far]
    assert far.sum() > 20
    assert (network.arrival_s[far] * speed <= along[far] * 1.001).all()
    assert (network.arrival_s[far] * speed >= along[far] / 1.05).all()
    env.close()


def test_no_link_leads_through_the_rock_between_passages_over_each_other(over):
    spans = spans_of(load_world(over))
    links = span_links(spans, 0.3)
    numbers = np.flatnonzero(links.standing)
    one, two = spans.floor_m[numbers][links.pairs].T
    assert np.abs(one - two).max() < 1.0
    assert not links.is_fall.any()


def test_a_robot_may_fall_down_a_shaft_in_less_time_than_it_needs_to_drive_anywhere(tmp_path):
    world = load_world(build_volume(PIT, tmp_path))
    spans = spans_of(world)
    links = span_links(spans, 0.3)
    numbers = np.flatnonzero(links.standing)
    falls = spans.floor_m[numbers][links.pairs[links.is_fall]]
    assert np.abs(np.diff(falls, axis=1)) == pytest.approx(12.0, abs=1e-6)
    assert links.length_m[links.is_fall] == pytest.approx(12 / 4, abs=1e-6)  # s


def test_free_heights_are_those_of_each_passage_and_half_a_metre_beside(over):
    spans = spans_of(load_world(over))
    free = free_heights(spans)
    both = np.isfinite(free.low_m).sum(axis=0)
    assert both.max() == 2
    row, col = np.argwhere(both == 2)[0]
    assert free.low_m[1, row, col] > free.high_m[0, row, col]
    assert (both > 0).sum() > len(np.unique(np.column_stack([spans.row, spans.column]), axis=0))


def test_a_walk_that_is_none_is_refused(box):
    env = MineVectorEnv(1, world=box, task=DRY)
    network = network_over_spans(CoverageProblem.of(env.robots), 4.0)
    with pytest.raises(BaselineError, match="no connected walk"):
        tour_over_spans(network, Walk(0, 0, []), env.world)
    env.close()


@pytest.mark.slow
def test_no_explorer_beats_the_bound_over_spans_and_the_tour_sees_nearly_all(over):
    env = MineVectorEnv(1, world=over, task={"max_steps": 3000, **DRY})
    network = network_over_spans(CoverageProblem.of(env.robots), 4.0)
    horizon = env.task.max_steps * env.task.control_s
    bounds = {t: best_walk(network, t).most for t in np.linspace(0, horizon, 16)}
    tour = OracleTour(1, env.task, env.robot, tour_over_spans(network, best_walk(network, 0.9 * horizon), env.world))
    for policy in (tour, make_policy("nearest-frontier", 1, env.task, env.robot, heights=True)):
        (episode,) = run_episodes(env, policy, [0])
        for t, most in bounds.items():  # samples lie 2 s apart
            assert episode.seen[min(int(t / 2), len(episode.seen) - 1)] <= most
        assert episode.seen[-1] > 0.95 * env.robots.grid.total
    assert bounds[horizon] == env.robots.grid.total
    assert 0 < bounds[0.0] < 0.4 * bounds[horizon]
    env.close()
