"""Parts of a scan's surface that nobody saw, and what fills them."""

import numpy as np
import pytest
import trimesh

from pipeline.survey.clouds.gaps import fill_gaps, find_gaps


@pytest.fixture(scope="module")
def floor():
    """Return points of a level floor with a hole of 1 m, and their normals."""
    points = np.random.default_rng(0).uniform([-3, -3, 0], [3, 3, 0], (4000, 3))
    points = points[np.linalg.norm(points[:, :2], axis=1) > 1]
    return points, np.tile([0.0, 0.0, 1.0], (len(points), 1))


def bulged(up):
    """Return a ball of 0.6 m over the middle of the floor, without the facets of which the heights are below `up`."""
    ball = trimesh.creation.icosphere(3, 0.6)
    ball.invert()
    faces = ball.faces[ball.triangles_center[:, 2] > up]
    return np.asarray(ball.vertices), np.asarray(faces)[:, ::-1]


def test_a_bulge_over_a_hole_is_filled_in_the_plane_of_the_floor(floor):
    vertices, faces = bulged(0.1)
    filled = fill_gaps(vertices, find_gaps(vertices, faces[:, ::-1], floor[0], 0.3), *floor)
    assert np.abs(filled[np.unique(faces)][:, 2]).max() < 0.02


def test_what_folds_over_keeps_its_place(floor):
    vertices, faces = bulged(-0.5)
    gaps = find_gaps(vertices, faces[:, ::-1], floor[0], 0.3)
    assert [gap.back_share > 0.25 for gap in gaps] == [True]
    assert (fill_gaps(vertices, gaps, *floor) == vertices).all()
