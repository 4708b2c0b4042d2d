"""Closed meshes that cross themselves are found again where they do, and stay elsewhere."""

import manifold3d
import numpy as np
import pytest
import trimesh

from pipeline.errors import InputError
from pipeline.geometry.facets.crossings import CROSSING_M, crossing_facets
from pipeline.scans.meshes import uncrossed as module
from pipeline.scans.meshes.uncrossed import _boxes, manifold_of, uncrossed


def two_balls(apart_m):
    """Balls 2 m wide whose surfaces cross in one mesh."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    vertices = np.concatenate([ball.vertices, ball.vertices @ [[0, 1, 0], [0, 0, 1], [1, 0, 0]] + [apart_m, 0, 0]])
    return vertices, np.concatenate([ball.faces, ball.faces + len(ball.vertices)]).astype(int)


def crossings_of(vertices, faces):
    return len(crossing_facets(vertices, faces, CROSSING_M))


@pytest.mark.parametrize("apart_m", [0.3, 1.2, 1.9])
def test_facets_that_cross_bound_the_union_and_others_keep_their_places(apart_m):
    vertices, faces = two_balls(apart_m)
    assert crossings_of(vertices, faces)
    found = uncrossed(vertices, faces)
    assert crossings_of(found.vertices, found.faces) == 0
    assert (found.crossed > 6, found.places > 0) == (True, True)
    one = manifold_of(vertices[: len(vertices) // 2], faces[: len(faces) // 2])
    union = one + manifold_of(vertices[len(vertices) // 2 :], faces[len(faces) // 2 :] - len(vertices) // 2)
    solid = manifold_of(found.vertices, found.faces)
    assert solid.status() == manifold3d.Error.NoError
    assert solid.volume() == pytest.approx(union.volume(), rel=0.01)
    far = (np.abs(vertices[:, 0] - apart_m / 2) > 0.6) & (np.linalg.norm(vertices - [apart_m, 0, 0], axis=1) > 0.99)
    far &= np.linalg.norm(vertices, axis=1) > 0.99
    kept = (found.vertices[:, None] == vertices[far]).all(axis=2).any(axis=0)
    assert kept.mean() > 0.95


def test_a_fold_that_reaches_out_of_the_space_is_cut_off():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    vertices = ball.vertices.copy()
    vertices[int(vertices[:, 2].argmax()), 2] = -1.3
    found = uncrossed(vertices, ball.faces.astype(int))
    assert crossings_of(found.vertices, found.faces) == 0
    assert found.vertices[:, 2].min() > -1.05


@pytest.mark.parametrize(("seed", "count"), [(0, 8), (2, 12)])
def test_no_facet_is_left_between_space_and_space(seed, count):
    """Surfaces that ended in one plane, a box's side, left walls without a thickness: of 1.5 and 2.3 cm2 here."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    places = np.random.default_rng(seed).uniform(0, 3, (count, 3))
    vertices = np.concatenate([ball.vertices + place for place in places])
    faces = np.concatenate([ball.faces + k * len(ball.vertices) for k in range(len(places))])
    found = uncrossed(vertices, faces.astype(int))
    assert crossings_of(found.vertices, found.faces) == 0
    corners = found.vertices[found.faces[module._folded(found.vertices, found.faces)[:, 0]]]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert area.sum() < 5e-5


def test_a_mesh_that_does_not_cross_stays_as_it_is():
    box = trimesh.creation.box([4, 3, 2])
    found = uncrossed(box.vertices, box.faces.astype(int))
    assert (found.vertices == box.vertices).all()
    assert (found.crossed, found.places) == (0, 0)


def test_a_mesh_that_still_crosses_is_refused_by_the_place(monkeypatch):
    vertices, faces = two_balls(1.2)
    monkeypatch.setattr(module, "_ROUNDS", 0)
    with pytest.raises(InputError, match=r"crosses itself at \(0\.\d, -?0\.\d, -?0\.\d\) m; --voxel"):
        uncrossed(vertices, faces)


def test_boxes_about_many_crossings_are_joined_until_none_meet():
    rng = np.random.default_rng(0)
    pairs = rng.uniform(0, 16, (2000, 1, 1, 3)) + rng.uniform(-0.1, 0.1, (2000, 2, 3, 3))
    low, high = pairs.min(axis=2).max(axis=1), pairs.max(axis=2).min(axis=1)
    boxes = _boxes(pairs, 0.15)
    assert 1 < len(boxes) < 2000
    inside = np.zeros(len(pairs), bool)
    for k, (least, most) in enumerate(boxes):
        inside |= ((least <= low) & (high <= most)).all(axis=1)
        meets = ((boxes[:, 0] <= most) & (least <= boxes[:, 1])).all(axis=1)
        assert np.flatnonzero(meets).tolist() == [k]
    assert inside.all()
