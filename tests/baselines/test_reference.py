"""What results are checked against: rock, lines of sight, and starts, in a T-junction of known measures."""

import numpy as np
import pytest

from baselines.environments import make_env
from baselines.errors import BaselineError
from baselines.protocol import SEEDS
from baselines.reference import reference_of


@pytest.fixture(scope="module")
def reference(tee_id):
    """Return the reference of the drift of 80 x 5 m with a branch at x = 38 to 43 m, 35 m long."""
    return reference_of(tee_id)


def test_distances_to_rock_are_those_of_the_plan(reference):
    places = np.array([[20.0, 2.5], [20.0, 0.5], [40.5, 20.0], [20.0, 6.0]])
    np.testing.assert_allclose(reference.rock.distances_m(places), [2.5, 0.5, 2.5, 0.0], atol=0.05)
    assert reference.rock.outside(np.array([[20.0, 2.5], [1e4, 0.0]])).tolist() == [False, True]


def test_a_way_through_a_corner_of_rock_is_blocked_and_the_way_round_is_longer(reference):
    west, north = (
        np.array([33.0, 4.4]),
        np.array([38.6, 10.0]),
    )  # rock fills the corner between
    assert reference.rock.blocked(west[None], north[None]).all()
    assert not reference.rock.blocked(west[None], np.array([[33.0, 1.0]])).any()
    straight, round_it = np.linalg.norm(north - west), np.hypot(5.4, 0.2) + np.hypot(5.5, 0.2)
    assert straight + 0.5 < reference.rock.detour_m(west, north, 12.0) <= round_it + 0.1
    assert reference.rock.detour_m(west, np.array([33.0, 20.0]), 16.0) == np.inf  # inside the rock: no way leads there


def test_cells_in_sight_are_those_along_free_lines(reference):
    def in_sight(x, y, path_m=0.0):
        place = np.array([x, y])
        return reference.sight.cells_between(place, place, path_m)

    grid = reference.env.robots.grid
    row, col = np.nonzero(grid.reachable)
    centres = grid.origin_m + (np.column_stack([col, row]) + 0.5) * grid.cell_m
    branch = centres[:, 1] > 8.0
    west = in_sight(10.0, 2.5)
    assert not west[branch].any()
    near = np.linalg.norm(centres - [10.0, 2.5], axis=1)
    assert west[(near < 9.0) & ~branch].all()
    assert not west[near > 14.0].any()
    assert in_sight(40.5, 2.5)[branch].any()
    assert in_sight(10.0, 2.5, 6.0).sum() > west.sum()


def test_what_robots_see_was_in_sight(reference, tee_id):
    env = make_env(tee_id, 4)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(4):
        before, old = env.robots.poses()[:, :2].copy(), env.robots.seen.copy()
        for _ in range(20):
            env.step(np.column_stack([np.ones(4), rng.uniform(-1, 1, 4)]))
        after = env.robots.poses()[:, :2]
        for robot in range(4):
            new = (env.robots.seen[robot] & ~old[robot])[env.robots.grid.reachable]
            path_m = 3.2
            assert not (new & ~reference.sight.cells_between(before[robot], after[robot], path_m)).any()
    env.close()


def test_starts_are_those_of_the_environment(reference, tee_id):
    env = make_env(tee_id, 3)
    _, info = env.reset(seed=[SEEDS[4], SEEDS[5], SEEDS[6]])
    np.testing.assert_array_equal(np.rint(100 * info["pose_m_rad"][:, :2]), reference.starts_cm[4:7])
    np.testing.assert_array_equal(info["cells_seen"], reference.first_seen[4:7])
    env.close()


def test_an_environment_is_named_by_its_whole_id(tee_id):
    with pytest.raises(BaselineError, match="env = 'Tee': valid choices are"):
        reference_of("Tee")
