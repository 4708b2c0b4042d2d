"""Facets that are cut finely: the mesh stays closed and in its place, with about two triangles a square."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from pipeline.geometry.facets.cut import cut_facets


def hull(points):
    mesh = trimesh.Trimesh(points, ConvexHull(points).simplices)
    mesh.fix_normals()
    return np.array(mesh.vertices), np.array(mesh.faces)


def box():
    mesh = trimesh.creation.box((7.0, 3.0, 2.0))
    return np.array(mesh.vertices), np.array(mesh.faces)


MESHES = {
    "box": box(),
    "flat": hull(np.random.default_rng(1).uniform(-1, 1, (60, 3)) * [20, 5, 0.3]),
    "round": hull(np.random.default_rng(2).normal(size=(40, 3)) / 0.3),
}


@pytest.mark.parametrize("name", MESHES)
def test_a_cut_mesh_is_closed_and_its_triangles_lie_in_their_facets_with_one_winding_and_an_area(name):
    vertices, faces = MESHES[name]
    apart = np.random.default_rng(3).uniform(0.1, 2.0, len(faces))
    points, triangles, facet = cut_facets(vertices, faces, apart)
    fine, coarse = trimesh.Trimesh(points, triangles, process=False), trimesh.Trimesh(vertices, faces, process=False)
    assert fine.is_watertight
    assert fine.is_winding_consistent
    assert len(np.unique(triangles)) == len(points)
    corners = points[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    along = (normal * coarse.face_normals[facet]).sum(axis=1)
    assert along.min() > 0
    assert along == pytest.approx(np.linalg.norm(normal, axis=1), rel=1e-6)
    assert np.bincount(facet, along / 2) == pytest.approx(coarse.area_faces)
    height = ((corners - vertices[faces[facet]][:, :1]) * coarse.face_normals[facet][:, None]).sum(axis=2)
    assert np.abs(height).max() < 1e-9


def test_a_square_of_the_spacing_has_two_triangles_and_sides_are_cut_at_the_lesser_spacing():
    vertices, faces = box()
    points, triangles, _ = cut_facets(vertices, faces, np.full(len(faces), 0.1))
    assert len(triangles) == pytest.approx(2 * 82.0 / 0.01, rel=0.02)
    corners = points[triangles]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() < 0.1 * 2.2
    top = np.isclose(vertices[faces][:, :, 2], 1.0).all(axis=1)
    points, _, _ = cut_facets(vertices, faces, np.where(top, 5.0, 0.1))
    on_top = points[np.isclose(points[:, 2], 1.0)]
    assert (np.abs(on_top[:, :2]) < [3.49, 1.49]).all(axis=1).sum() <= 1  # on the diagonal
    assert np.isclose(on_top[:, 1], 1.5).sum() == 71


def test_facets_no_longer_than_the_spacing_stay_as_they_are():
    vertices, faces = MESHES["round"]
    points, triangles, facet = cut_facets(vertices, faces, np.full(len(faces), 100.0))
    assert np.array_equal(points, vertices)
    assert np.array_equal(np.sort(triangles, axis=1), np.sort(faces[facet], axis=1))
