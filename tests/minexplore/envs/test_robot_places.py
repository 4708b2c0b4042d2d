"""Where robots are is asked for several times a step, and follows every change of their states."""

import numpy as np
import pytest

from minexplore.envs.vector import MineVectorEnv
from minexplore.rotations import rotate_inverse, rotation_matrices


@pytest.fixture(scope="module")
def robots(tee):
    env = MineVectorEnv(3, world=tee.bundle)
    env.reset(seed=0)
    yield env.robots
    env.close()


def test_places_follow_a_robot_that_is_placed_and_a_state_that_is_written(robots):
    robots.place(1, 20.0, 2.5, 0.7)
    np.testing.assert_allclose(robots.poses()[1], [20.0, 2.5, 0.7], atol=1e-9)
    before = robots.heights(np.arange(3))
    robots.qpos[2, :3] += robots.T_world_mine[:3, 2] * 0.5
    np.testing.assert_allclose(robots.heights(np.arange(3)) - before, [0.0, 0.0, 0.5], atol=1e-9)
    tilted = robots.state.copy()
    robots.qpos[0, 3:7] = [np.cos(0.1), np.sin(0.1), 0.0, 0.0]
    np.testing.assert_allclose(robots.attitudes(np.array([0]))[0], [0.0, 0.2], atol=1e-9)
    robots.state[:] = tilted


def test_some_robots_and_all_have_the_same_digits(robots):
    every = robots.poses()
    for some in (np.array([2]), np.array([0, 2])):
        np.testing.assert_array_equal(robots.poses(some), every[some])
        matrices = rotation_matrices(robots.qpos[some, 3:7])
        axes = robots._stances(some).axes
        for k in range(3):
            np.testing.assert_array_equal(axes[:, k], rotate_inverse(matrices[:, :, k], robots.T_world_mine[:3, :3]))


def test_what_is_kept_between_questions_cannot_be_written(robots):
    with pytest.raises(ValueError, match="read-only"):
        robots._mine_places(np.arange(3))[0, 0] = 1.0
