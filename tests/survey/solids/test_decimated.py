"""Closed surfaces with fewer facets."""

import manifold3d
import numpy as np
import pytest
import trimesh

from pipeline.params.survey import SolidSurveyParams
from pipeline.survey.solids.decimate import decimated
from pipeline.survey.solids.read import read_solid


def test_a_flat_surface_keeps_its_place_with_few_facets():
    box = trimesh.creation.box([20, 4, 3]).subdivide().subdivide().subdivide().subdivide()
    vertices, faces, moved_m = decimated(box.vertices, box.faces, 0.01, 20_000)
    assert len(faces) < len(box.faces) / 10
    assert moved_m < 0.01
    found = trimesh.Trimesh(vertices, faces, process=False)
    assert found.is_watertight
    assert found.volume == pytest.approx(20 * 4 * 3, rel=1e-3)


def test_no_more_facets_than_the_most_are_left_and_how_far_the_surface_moved_is_told():
    ball = trimesh.creation.icosphere(subdivisions=5, radius=5.0)
    _, faces, moved_m = decimated(ball.vertices, ball.faces, 1e-4, 3000)
    assert len(faces) <= 3000
    # Over an equilateral triangle of the area the sphere rises by edge**2 / (6 * radius).
    rise_m = 4 * np.pi * 25 / 3000 * 4 / np.sqrt(3) / (6 * 5)
    assert rise_m / 2 < moved_m < 2 * rise_m


def test_a_scanned_cave_has_no_facets_that_lie_on_each_other(shared_rock):
    params = SolidSurveyParams(kind="solid", name="a", file="data/x", heights=None, simplify_m=0.03)
    solid = read_solid(params.model_copy(update={"file": shared_rock.as_posix()})).solid
    mesh = manifold3d.Mesh64(solid.vertices.copy(), solid.faces.astype(np.uint64))
    assert manifold3d.Manifold(mesh).num_tri() == len(solid.faces) < 5000
    assert len(solid.scan_m) == 200_000  # what the world is compared with
