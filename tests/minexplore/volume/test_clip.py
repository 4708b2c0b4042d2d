"""Convex parts cut to a box."""

import manifold3d
import numpy as np
import pytest

from minexplore.volume.models import clip_convex

CUBE = np.array([[x, y, z] for x in (0, 2) for y in (0, 2) for z in (0, 2)], float)


def volume_of(corners):
    return manifold3d.Manifold.hull_points(corners).volume()


def test_a_part_inside_a_box_is_left_as_it_is():
    assert clip_convex(CUBE, np.full(3, -1.0), np.full(3, 3.0)) is CUBE


def test_a_part_outside_of_a_box_has_no_corners_left():
    assert len(clip_convex(CUBE, np.full(3, 3.0), np.full(3, 4.0))) == 0


def test_a_cube_that_is_cut_to_its_middle_has_the_corners_of_a_cube():
    found = clip_convex(CUBE, np.full(3, 0.5), np.full(3, 1.5))
    assert sorted(map(tuple, found.tolist())) == sorted(
        (x, y, z) for x in (0.5, 1.5) for y in (0.5, 1.5) for z in (0.5, 1.5)
    )


def test_random_parts_cut_to_random_boxes_have_the_volume_that_booleans_give_them():
    rng = np.random.default_rng(0)
    for _ in range(100):
        corners = rng.normal(size=(rng.integers(4, 20), 3))
        low = rng.uniform(-1, 0.2, 3)
        high = low + rng.uniform(0.1, 1.5, 3)
        box = manifold3d.Manifold.cube((high - low).tolist()).translate(low.tolist())
        wanted = (manifold3d.Manifold.hull_points(corners) ^ box).volume()
        found = clip_convex(corners, low, high)
        assert len(found) < 60
        assert (volume_of(found) if len(found) > 3 else 0.0) == pytest.approx(wanted, abs=1e-9)
