"""The environment's timing: both sides of a ratio drive the same steps, and the page marks what misses its limit."""

import numpy as np
import pytest

from benchmarks.speed.time_env import paired_steps_per_s, start_at_entrance, start_spread
from minexplore.envs.vector import MineVectorEnv


@pytest.fixture(scope="module")
def pair(ring):
    envs = tuple(MineVectorEnv(6, ring.bundle, threads=threads) for threads in (1, 2))
    yield envs
    for env in envs:
        env.close()


@pytest.mark.parametrize("start", [start_spread, start_at_entrance])
def test_one_thread_and_two_are_timed_over_the_same_steps_of_the_same_drives(pair, start):
    for _ in range(2):
        rates = paired_steps_per_s(pair, start, 5)
        one, two = (env.robots for env in pair)
        assert (one.steps == 5).all()
        assert (two.steps == 5).all()
        assert np.array_equal(one.poses(), two.poses())
        assert min(rates) > 0


def test_robots_are_spread_over_the_mine(pair):
    start_spread(pair[0])
    places = pair[0].robots.poses()[:, :2]
    start_at_entrance(pair[0])
    assert np.ptp(pair[0].robots.poses()[:, :2], axis=0).max() < 1.0
    apart = np.linalg.norm(places[:, None] - places, axis=-1)[~np.eye(6, dtype=bool)]
    assert apart.min() > 2.0
    free = pair[0].world.places_m(0.6)
    assert (np.ptp(places, axis=0) > 0.7 * np.ptp(free, axis=0)).all()
