"""Floors whose lines have one height: level, with the corners of the walls alone."""

import numpy as np
import pytest
import shapely

from pipeline.errors import GeometryError
from pipeline.geometry.floor.mesh import build_floor

DRIFT = shapely.box(0, 0, 90, 4)
LINE = np.array([[1.0, 2.0, 7.5], [89.0, 2.0, 7.5]])


def area_m2(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def test_a_floor_of_one_height_has_the_corners_of_its_walls_and_the_drawn_area():
    mesh = build_floor(DRIFT, [LINE], 100.0)
    assert (len(mesh.vertices), len(mesh.faces), mesh.datum_m) == (4, 2, 100.0)
    assert (mesh.vertices[:, 2] == 7.5).all()
    assert area_m2(mesh) == pytest.approx(DRIFT.area)


def test_a_floor_that_falls_by_a_centimetre_keeps_the_points_of_its_line():
    falling = LINE - [[0, 0, 0], [0, 0, 0.01]]
    mesh = build_floor(DRIFT, [falling], 0.0)
    assert len(mesh.vertices) > 60
    assert np.interp(45, falling[:, 0], falling[:, 2]) == pytest.approx(7.495)
    assert mesh.vertices[:, 2].min() == pytest.approx(7.49, abs=1e-6)


def test_a_piece_of_workings_without_a_line_is_refused_with_its_place():
    apart = shapely.MultiPolygon([DRIFT, shapely.box(200, 50, 210, 60)])
    with pytest.raises(GeometryError, match=r"no height is known for the workings at \((200|210)\.0, (50|60)\.0\)"):
        build_floor(apart, [LINE], 0.0)
