"""Workings that walls enclose, where the walls are drawn as lines that end at each other."""

import math

import numpy as np
import pytest
import shapely
from shapely import LineString

from pipeline.geometry.outline.enclosure import enclose_workings

ROOM = shapely.box(0, 0, 30, 10)
TURNS_DEG = np.linspace(3, 357, 60)


def turned(lines, turn_deg):
    """Return lines turned and moved, as a CAD program stores those of a rotated drawing."""
    cos, sin = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    there = np.array([[cos, sin], [-sin, cos]])
    return [LineString(np.array(line) @ there + (381.25, -77.5)) for line in lines]


@pytest.mark.parametrize("gap_m", [0.0, 0.003])
def test_a_wall_that_ends_at_the_middle_of_a_slanted_one_closes_the_room_at_any_angle(gap_m):
    lines = [
        [(-3, 0), (33, 0)],
        [(-3, 10), (33, 10)],
        [(0, gap_m), (0, 10 - gap_m)],
        [(30, gap_m), (30, 10 - gap_m)],
    ]
    areas = [enclose_workings(turned(lines, turn), 0.05, []).area for turn in TURNS_DEG]
    assert areas == pytest.approx([ROOM.area] * len(areas), rel=1e-3)


def test_ends_that_differ_by_rounding_meet():
    lines = [[(0, 0), (30, 0)], [(30 + 1e-13, 0), (30, 10)], [(30, 10), (0, 10 + 2e-13)], [(0, 10), (0, 1e-14)]]
    areas = [enclose_workings(turned(lines, turn), 0.0, []).area for turn in TURNS_DEG]
    assert areas == pytest.approx([ROOM.area] * len(areas), rel=1e-6)
