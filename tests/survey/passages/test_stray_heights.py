"""Elevations of 0 that stand for a missing value."""

import numpy as np

from minesurveys.coordinates.stray_heights import stray_zero


def test_a_level_or_a_collar_at_the_height_0_is_no_missing_elevation():
    level = np.array([[k, 0.0, 0.0] for k in range(9)] + [[k, 9.0, -40.0] for k in range(9)])
    assert stray_zero(level) is None
    assert stray_zero(np.array([[0.0, 0, 0], [0, 0, -40], [9, 0, -40]])) is None
    assert stray_zero(np.array([[0.0, 0, 0], [5, 0, -40], [9, 0, -40]])) == 0
