"""Two triangle surfaces are compared in place, however long their triangles are."""

import numpy as np

from pipeline.geometry.floor.subdivide import split_edges
from pipeline.proof.rebuilt.same_surface import NearestFace, triangles_differ

# A chamfer of 0.9 m along 80 m of wall, as two triangles, and a third that is 100 m long and 4 cm high.
CHAMFER = np.array([[30.0, 5, 2.6], [110, 5, 2.6], [110, 4.1, 3.5], [30, 4.1, 3.5]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
THIN = np.array([[[30.0, 5, 2.6], [130, 5, 2.6], [90, 4.97, 2.63]]])


def split_long_edges(points, faces, most_m):
    return split_edges(points, faces, lambda one, two: np.linalg.norm(one - two, axis=1) > most_m)


def test_the_distance_to_a_long_thin_triangle_is_right_to_a_centimetre():
    places = np.random.default_rng(0).dirichlet([1, 1, 1], 1000) @ THIN[0]
    apart, owner = NearestFace(THIN).query(places)
    assert apart.max() < 0.01
    assert not owner.any()


def test_a_long_chamfer_is_the_same_in_short_pieces():
    points, faces = split_long_edges(CHAMFER, FACES, 0.7)
    pieces = points[faces]
    assert set(NearestFace(CHAMFER[FACES]).query(pieces.mean(axis=1))[1].tolist()) == {0, 1}
    assert triangles_differ(pieces, CHAMFER[FACES], split=True) is None


def test_a_chamfer_with_a_dent_is_another():
    wide = CHAMFER * [1, 9, 9]
    points, faces = split_long_edges(wide, FACES, 4.0)
    inside = np.flatnonzero(abs(points[:, 1] - 41) < 2)
    points[inside[len(inside) // 2]] += [0, -0.11, -0.11]
    assert "from where it should be" in triangles_differ(points[faces], wide[FACES], split=True)


def test_a_thin_face_that_a_fold_turns_over_in_its_wall_is_the_same_surface_and_a_turned_wall_is_not():
    wall = np.array([[[0.0, 0, 0], [8, 0, 0], [8, 0, 3]], [[0, 0, 0], [8, 0, 3], [0, 0, 3]]])
    turned = np.array([[[2.0, 0, 1], [4, 0, 1.02], [6, 0, 1.0]]])[:, ::-1]
    for folded in (np.concatenate([wall, turned]), np.concatenate([turned, wall])):
        assert triangles_differ(folded, folded) is None
        assert triangles_differ(folded, folded[:, ::-1]) == "a face that faces the wrong way"
    assert triangles_differ(wall[:, ::-1], wall) == "a face that faces the wrong way"
