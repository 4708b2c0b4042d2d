"""Closed meshes that cross themselves are smoothed where they do, and nowhere else."""

import numpy as np
import pytest
import trimesh

from pipeline.errors import GeometryError
from pipeline.volume.crossings import CROSSING_M, crossing_facets
from pipeline.volume.world import uncrossed as module
from pipeline.volume.world.uncrossed import uncrossed


def folded():
    """A ball 2 m wide; one corner of its top is pulled out of its bottom."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    vertices, top = ball.vertices.copy(), int(ball.vertices[:, 2].argmax())
    vertices[top, 2] = -1.3
    return vertices, ball.faces.astype(int), top


def test_facets_that_cross_are_smoothed_and_others_keep_their_places():
    vertices, faces, top = folded()
    assert len(crossing_facets(vertices, faces, CROSSING_M))
    found = uncrossed(vertices, faces)
    assert len(crossing_facets(found.vertices, faces, CROSSING_M)) == 0
    assert found.crossed >= 6
    moved = np.linalg.norm(found.vertices - vertices, axis=1)
    assert (moved > 0)[top]
    assert (moved > 0).mean() < 0.2
    assert found.moved_m == moved.max()


def test_a_mesh_that_does_not_cross_stays_as_it_is():
    box = trimesh.creation.box([4, 3, 2])
    found = uncrossed(box.vertices, box.faces.astype(int))
    assert (found.vertices == box.vertices).all()
    assert (found.crossed, found.moved_m) == (0, 0)


def test_a_mesh_that_still_crosses_is_refused_by_the_place(monkeypatch):
    vertices, faces, _ = folded()
    monkeypatch.setattr(module, "_ROUNDS", 0)
    with pytest.raises(GeometryError, match=r"crosses itself at \(-?0\.\d, -?0\.\d, -?[01]\.\d\) m; --voxel"):
        uncrossed(vertices, faces)
