"""The report of a mine with heights: plans of levels, long section, grades."""

import numpy as np
import pytest

from pipeline.report.figures.levels import draw_levels, draw_long_section, leg_grades
from tests.heights import UNDER


@pytest.fixture(scope="module")
def under(mine_of_legs):
    """Return a drift under a drift, joined by a ramp of 9 m."""
    return mine_of_legs(UNDER, "preset=light")


def test_grades_are_those_of_the_survey(under):
    grades = leg_grades(under.network, under.floor, under.survey.heights.datum_m)
    ends = [level for leg in grades for level in (leg.from_m, leg.to_m)]
    assert min(ends) == pytest.approx(1.0, abs=0.02)
    assert max(ends) == pytest.approx(10.0, abs=0.02)
    # The steepest leg of the table falls by 2.2 m over 17 m.
    assert max(leg.steepest for leg in grades) == pytest.approx(2.2 / 17.0, abs=0.02)
    level = [leg for leg in grades if abs(leg.to_m - leg.from_m) < 0.01]
    assert level
    assert all(abs(leg.mean) < 0.001 for leg in level)


def test_each_sheet_is_drawn_in_its_place(under):
    figure = draw_levels(under.free_space.polygon, under.network, under.floor, under.survey.heights.datum_m)
    assert len(figure.axes) == len(under.floor.offset_m) == 2
    titles = [axis.get_title() for axis in figure.axes]
    assert titles[0].endswith("10.0 m")
    assert " 1.0 to " in titles[1]
    for axis in figure.axes:  # the sheets lie side by side in plan, 90 m and more; in the mine they share 62 m by 64 m
        west, east = axis.get_xlim()
        assert east - west < 105


def test_the_long_section_reaches_from_the_lowest_floor_to_the_highest_roof(under):
    figure = draw_long_section(under.floor, 3.5, under.survey.heights.datum_m)
    walls = np.concatenate([path.vertices for path in figure.axes[0].collections[0].get_paths()])
    assert walls[:, 1].min() == pytest.approx(1.0, abs=0.01)
    assert walls[:, 1].max() == pytest.approx(13.5, abs=0.01)
