"""Rotations of one robot and of many round alike."""

import numpy as np

from minexplore.rotations import rotate_inverse, rotation_matrices


def test_one_row_has_the_bits_that_it_has_among_many():
    rng = np.random.default_rng(4)
    quats, vectors = rng.normal(size=(500, 4)), rng.normal(size=(500, 3))
    matrices = rotation_matrices(quats)
    rotated = rotate_inverse(vectors, matrices[0])
    for k in range(500):
        assert (rotation_matrices(quats[k : k + 1]) == matrices[k]).all()
        for few in (1, 3, 4):
            assert (rotate_inverse(vectors[k : k + few], matrices[0]) == rotated[k : k + few]).all()


def test_a_rotation_of_no_rows_has_none():
    assert rotate_inverse(np.zeros((0, 3)), np.eye(3)).shape == (0, 3)
    assert rotation_matrices(np.zeros((0, 4))).shape == (0, 3, 3)
