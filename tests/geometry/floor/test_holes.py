"""A hole in a surface leaves its border as the only new rim, whatever the surface's faces are."""

import numpy as np
import pytest
import shapely
from scipy.spatial import Delaunay

from pipeline.geometry.floor.holes import cut_hole, faces_over


def square(middle, side, turn):
    c, s = np.cos(turn), np.sin(turn)
    corners = side / 2 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return middle + corners @ np.array([(c, s), (-s, c)])


def area_of(points, faces):
    return float(shapely.area(shapely.polygons(points[faces][:, :, :2])).sum())


def rim_of(cut):
    edges, count = np.unique(
        np.sort(cut.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True
    )
    assert count.max() == 2
    return cut.points[edges[count == 1]]


@pytest.mark.parametrize("seed", range(20))
def test_the_rim_of_a_hole_in_a_random_surface_is_its_border(seed):
    rng = np.random.default_rng(seed)
    places = np.vstack([rng.uniform(0, 10, (300, 2)), [[0, 0], [10, 0], [10, 10], [0, 10]]])
    points = np.column_stack([places, rng.normal(3, 0.2, len(places))])
    faces = Delaunay(places).simplices[:, :: 1 - 2 * (seed % 2)]  # seen from above, and from below
    side = rng.uniform(0.05, 4)
    hole = square(rng.uniform(3, 7, 2), side, rng.uniform(0, 6))
    cut = cut_hole(points, faces, hole)
    rim = rim_of(cut)[:, :, :2]
    outside = ((rim == 0) | (rim == 10)).any(axis=2).all(axis=1)
    border = shapely.Polygon(hole).exterior
    assert shapely.distance(border, shapely.points(rim[~outside])).max() < 0.0201
    assert area_of(points, faces) - area_of(cut.points, cut.faces) == pytest.approx(side**2, abs=0.08)
    np.testing.assert_array_equal(cut.points[: len(points)], points)
    old, new = points[faces[cut.of_face]], cut.points[cut.faces]
    turn = [np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])[:, 2] for t in (old, new)]
    assert (turn[0] * turn[1] > 0).all()  # no face is turned over
    np.testing.assert_array_less(np.linalg.norm(cut.points - points[cut.near], axis=1), 3.0)


def test_a_hole_within_one_face_and_one_through_its_corners_are_cut():
    points = np.array([[0, 0, 1], [4, 0, 2], [4, 4, 3], [0, 4, 2.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    within = cut_hole(points, faces, square([3, 1], 0.5, 0.1))
    assert area_of(within.points, within.faces) == pytest.approx(16 - 0.25)
    heights = within.points[4:, 2]
    np.testing.assert_allclose(heights, 1 + within.points[4:, 0] / 4 + within.points[4:, 1] / 4)
    fine = np.array([[x, y, 0.0] for x in range(5) for y in range(5)])
    cut = cut_hole(fine, Delaunay(fine[:, :2]).simplices, square([2, 2], 2.0, 0.0))  # its corners are points
    assert area_of(cut.points, cut.faces) == pytest.approx(16 - 4, abs=0.02)
    rim_of(cut)


def test_no_face_lies_over_a_hole_that_only_touches_it():
    points = np.array([[0, 0, 1], [4, 0, 2], [4, 4, 3], [0, 4, 2.0]])
    assert not len(faces_over(points, np.array([[0, 1, 2], [0, 2, 3]]), square([5, 2], 2.0, 0.0)))
