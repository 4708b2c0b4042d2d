"""Triangles are split where they are long, on every processor at the same sides."""

import numpy as np
import pytest

from pipeline.proof.surface import split_long


def wall(scale):
    """Return a wall of 12 x 3 m as two triangles (2, 3, 3) m, whose corners differ by rounding."""
    low, high = np.array([[0.0, 0, 0], [12, 0, 0]]), np.array([[0.0, 0, 3], [12, 0, 3]])
    triangles = np.array([[low[0], low[1], high[1]], [low[0], high[1], high[0]]])
    return triangles * scale


@pytest.mark.parametrize("scale", [1 + 2e-15, 1 - 2e-15, np.array([1 + 2e-15, 1, 1 - 2e-15])])
def test_sides_that_tie_are_split_alike_whatever_the_last_digit_is(scale):
    found, exact = split_long(wall(scale)), split_long(wall(1.0))
    assert len(exact) > 2
    assert np.array_equal(found.round(9), exact.round(9))
    assert np.linalg.norm(exact - np.roll(exact, -1, axis=1), axis=2).max() <= 3.0
