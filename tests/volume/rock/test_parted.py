"""Corners of a mesh at one place are parted."""

import numpy as np
import trimesh

from pipeline.geometry.facets.crossings import CROSSING_M, crossing_facets
from pipeline.volume.rock.parted import parted


def test_corners_at_one_place_are_parted_by_a_millimetre_at_most():
    box = trimesh.creation.box([1, 1, 1])
    vertices = np.concatenate([box.vertices, box.vertices + np.array([1, 1, 0])])  # they touch in an edge
    faces = np.concatenate([box.faces, box.faces + 8]).astype(int)
    assert len(np.unique(vertices.astype(np.float32), axis=0)) == 14
    found = parted(vertices, faces)
    assert len(np.unique(found.astype(np.float32), axis=0)) == 16
    moved = np.linalg.norm(found - vertices, axis=1)
    assert (moved > 0).sum() == 4
    assert moved.max() <= 1.0001e-3
    assert len(crossing_facets(found, faces, CROSSING_M)) == 0
    assert parted(box.vertices, box.faces.astype(int)) is box.vertices
