"""Two triangle surfaces are compared in place, however long their triangles are."""

import numpy as np
import trimesh

from pipeline.proof.rebuilt.smooth import triangles_differ

# A chamfer of 0.9 m along 80 m of wall, as two triangles.
CHAMFER = np.array([[30.0, 5, 2.6], [110, 5, 2.6], [110, 4.1, 3.5], [30, 4.1, 3.5]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def test_a_chamfer_with_a_dent_is_another():
    points, faces = trimesh.remesh.subdivide_to_size(CHAMFER * [1, 9, 9], FACES, 4.0)
    wide = points[faces]
    assert triangles_differ(wide, wide) is None
    inside = np.flatnonzero(abs(points[:, 1] - 41) < 2)
    points[inside[len(inside) // 2]] += [0, -0.11, -0.11]
    assert "from where it should be" in triangles_differ(points[faces], wide)


def test_a_wall_that_is_turned_over_is_another():
    wall = np.array([[[0.0, 0, 0], [8, 0, 0], [8, 0, 3]], [[0, 0, 0], [8, 0, 3], [0, 0, 3]]])
    assert triangles_differ(wall, wall) is None
    assert triangles_differ(wall[:, ::-1], wall) == "a face that faces the wrong way"
