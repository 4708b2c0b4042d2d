"""Floors that meet are stitched into one mesh: no step, no gap, and nothing joined that only touches."""

import numpy as np
import pytest
import shapely

from pipeline.geometry.floor.stitched import FloorPart, stitch
from pipeline.geometry.rock.partition import triangulate


def part(outline, z):
    """Return a floor over an outline, at the heights z(x, y)."""
    points, faces = triangulate(outline)
    return FloorPart(np.column_stack([points, [z(x, y) for x, y in points]]), faces)


def edges_of(faces):
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    return np.unique(np.sort(ends, axis=1), axis=0, return_counts=True)[1]


def test_a_ramp_and_its_level_share_the_corners_of_their_edge_at_the_height_of_the_first():
    level = part(shapely.box(20, 0, 40, 4), lambda x, y: 2.0)
    ramp = part(shapely.box(0, 0, 20.0005, 4), lambda x, y: 0.1 * x + 0.2)
    found = stitch([level, ramp], 1e-3, 0.3)
    assert len(found.vertices) == 6
    assert found.joined.tolist() == [[0, 1]]
    assert sorted(edges_of(found.faces).tolist()) == [1] * 6 + [2] * 3
    shared = found.vertices[np.abs(found.vertices[:, 0] - 20) < 0.01]
    assert sorted(shared.tolist()) == [pytest.approx([20, 0, 2]), pytest.approx([20, 4, 2])]


def test_floors_over_each_other_and_floors_that_meet_in_a_corner_stay_apart():
    one = part(shapely.box(0, 0, 10, 10), lambda x, y: 0.0)
    over = part(shapely.box(0, 0, 10, 10), lambda x, y: 6.0)
    corner = part(shapely.box(10, 10, 20, 20), lambda x, y: 0.0)
    found = stitch([one, over, corner], 1e-3, 0.3)
    assert (len(found.vertices), len(found.joined)) == (12, 0)
    assert edges_of(found.faces).max() == 2


def test_a_corner_of_two_fans_becomes_two_vertices():
    parts = [part(shapely.box(*box), lambda x, y: 0.0) for box in ((0, 0, 1, 1), (1, 0, 2, 1), (2, 1, 3, 2))]
    found = stitch(parts, 1e-3, 0.3)
    at = np.linalg.norm(found.vertices[:, :2] - [2, 1], axis=1) < 1e-6
    assert at.sum() == 2
    assert found.joined.tolist() == [[0, 1]]
