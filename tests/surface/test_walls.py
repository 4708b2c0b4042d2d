"""Wall lines of the rough surface: rounded corners."""

import numpy as np
import pytest
import shapely
from shapely import Polygon

from pipeline.surface.mesh.walls import fillet


def forked(angle_deg, half_m=2.0, long_m=30.0):
    """Return two drifts that part at an angle, and the end of the rock between them."""
    ends = [long_m * np.array([np.cos(a), np.sin(a)]) for a in np.radians([angle_deg / 2, -angle_deg / 2])]
    drifts = [shapely.LineString([(0, 0), end]).buffer(half_m, cap_style="flat") for end in ends]
    stem = shapely.LineString([(-long_m, 0), (0, 0)]).buffer(half_m, cap_style="flat")
    return shapely.union_all([*drifts, stem]), shapely.Point(half_m / np.sin(np.radians(angle_deg / 2)), 0)


@pytest.mark.parametrize("angle_deg", [10, 16, 28, 40])
def test_a_sharp_nose_of_rock_between_two_drifts_loses_at_most_0_3_m(angle_deg):
    free, nose = forked(angle_deg)
    rounded = fillet(free)
    assert rounded.is_valid
    assert 0.05 < rounded.boundary.distance(nose) < 0.31


@pytest.mark.parametrize("angle_deg", [60, 90])
def test_a_blunt_nose_is_rounded_by_0_2_m(angle_deg):
    free, nose = forked(angle_deg)
    lost = 0.2 * (1 / np.sin(np.radians(angle_deg / 2)) - 1)
    assert fillet(free).boundary.distance(nose) == pytest.approx(lost, abs=0.005)


def test_corners_beside_a_sharp_nose_are_rounded_as_without_it():
    free, nose = forked(16)
    square = shapely.box(-29, 2, -25, 8)
    rounded, plain = fillet(free.union(square)), fillet(shapely.box(-60, -2, 0, 2).union(square))
    away = shapely.box(-27, -1, -20, 9)
    assert rounded.intersection(away).symmetric_difference(plain.intersection(away)).area < 1e-9
    assert isinstance(rounded, Polygon)
    assert rounded.boundary.distance(nose) < 0.3
