"""Parts of a scan's surface that nobody saw, and what fills them."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from pipeline.survey.clouds.gaps import fill_gaps, find_gaps, plates_of


@pytest.fixture(scope="module")
def floor():
    """Return points of a level floor with a hole of 1 m, and their normals."""
    points = np.random.default_rng(0).uniform([-3, -3, 0], [3, 3, 0], (4000, 3))
    points = points[np.linalg.norm(points[:, :2], axis=1) > 1]
    return points, np.tile([0.0, 0.0, 1.0], (len(points), 1))


def bulged(radius_m):
    """Return the upper half of a ball over the middle of the floor, with normals into the rock below."""
    ball = trimesh.creation.icosphere(3, radius_m)
    return np.asarray(ball.vertices), np.asarray(ball.faces[ball.triangles_center[:, 2] > 0.05])[:, ::-1]


@pytest.mark.parametrize(("radius_m", "is_filled"), [(0.5, True), (0.95, False)])
def test_a_bulge_over_a_hole_is_filled_in_the_plane_of_the_floor_unless_it_is_far_from_it(floor, radius_m, is_filled):
    vertices, faces = bulged(radius_m)
    gaps = find_gaps(vertices, faces, floor[0], 0.04)
    filled = fill_gaps(vertices, faces, plates_of(vertices, gaps, *floor, 0.45))
    far = cKDTree(floor[0]).query(vertices)[0] > 0.1
    if is_filled:
        assert np.abs(filled[far & np.isin(np.arange(len(vertices)), faces)][:, 2]).max() < 0.02
    else:
        assert (filled == vertices).all()


def test_corners_whose_facets_would_turn_over_stay(floor):
    vertices, faces = bulged(0.5)
    gaps = find_gaps(vertices, faces, floor[0], 0.04)
    plates = plates_of(vertices, gaps, *floor, 0.45)
    overhanging = vertices.copy()
    top = int(vertices[:, 2].argmax())
    overhanging[top, 0] += 0.3  # beyond the corners about it
    filled = fill_gaps(overhanging, faces, plates)
    own = faces[(filled != overhanging).any(axis=1)[faces].any(axis=1)]
    before, after = (np.cross(v[own[:, 1]] - v[own[:, 0]], v[own[:, 2]] - v[own[:, 0]]) for v in (overhanging, filled))
    assert ((before * after).sum(axis=1) > 0).all()
    assert filled[top, 2] == overhanging[top, 2]
