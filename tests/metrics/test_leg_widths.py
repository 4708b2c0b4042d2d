"""Widths along a survey's legs, and what is cut off from a robot's start."""

import dataclasses

import numpy as np
import pytest
import shapely

from pipeline.compose import compose
from pipeline.metrics.leg_widths import free_widths, measure_legs, sections_along
from pipeline.metrics.limits import breaches
from pipeline.survey.passages.workings import build_workings
from tests.survey.passages.test_bends import leg_of

RADIUS_M = 0.35


def sections_of_leg(leg):
    both = [np.stack([rows[:-1], rows[1:]], axis=1) for rows in (leg.positions_m, leg.walls_m)]
    return sections_along(*both, list(zip(leg.stations, leg.stations[1:], strict=False)))


def measured(free, leg, start=(0.0, 0.0)):
    return measure_legs(free, sections_of_leg(leg), start, RADIUS_M, 0.05)


def test_a_section_is_as_long_as_its_longest_free_stretch():
    leg = leg_of([(0, 0), (10, 0)])
    sections = sections_of_leg(leg)
    pillar = shapely.box(4, -1, 6, 0)
    widths = free_widths(shapely.box(-1, -2, 11, 2).difference(pillar), sections)
    in_pillar = np.abs(sections.on_legs_m[:, 0] - 5) < 0.9
    assert widths[in_pillar] == pytest.approx(2.0)
    assert widths[np.abs(sections.on_legs_m[:, 0] - 5) > 1.1] == pytest.approx(4.0)


def test_a_passage_beside_where_it_was_surveyed_is_as_wide_but_not_one_that_is_farther_off():
    leg = leg_of([(0, 0), (10, 0)])
    for aside, width in ((0.2, 4.0), (1.0, 3.2)):
        free = shapely.box(-1, -2 + aside, 11, 2 + aside)
        assert free_widths(free, sections_of_leg(leg)) == pytest.approx(width)


def test_what_the_builder_makes_of_a_survey_is_as_wide_and_reached():
    leg = leg_of([(0, 0), (60, 0), (60, 10), (0, 10)])
    found = measured(build_workings([leg]), leg)
    assert found.least_width_share == pytest.approx(1.0)
    assert (found.narrowed_m, found.cut_off_m) == (0.0, 0.0)
    assert found.reached_share > 0.99


def test_a_crosscut_that_is_pinched_is_refused_with_its_place():
    leg = leg_of([(0, 0), (60, 0), (60, 10), (0, 10)])
    free = build_workings([leg]).difference(shapely.box(60.3, 2, 63, 8)).difference(shapely.box(57, 2.1, 59.7, 7.9))
    found = measured(free, leg)
    assert found.least_width_share == pytest.approx(0.6 / 4, abs=0.01)
    assert found.cut_off_m == pytest.approx(70, abs=3)
    assert found.reached_share < 0.6
    limits = {name: limit for name, limit in compose([]).validation.limits.items() if name.startswith("survey.")}
    lines = breaches({"survey": dataclasses.asdict(found)}, limits)
    assert [line.partition(" =")[0] for line in lines] == ["survey.narrowed_m", "survey.cut_off_m"]
    assert all("leg s1 to s2 at (60.0, 2." in line for line in lines)


def test_what_the_survey_itself_parts_need_not_be_reached():
    leg = leg_of([(0, 0), (20, 0), (40, 5), (60, 5)])
    leg.walls_m[1] = 0.1
    found = measured(build_workings([leg]), leg)
    assert found.cut_off_m == 0
    assert found.narrowed_m == 0
    assert found.reached_share < 0.5


def test_robots_that_do_not_fit_at_their_start_reach_nothing():
    leg = leg_of([(0, 0), (20, 0)])
    assert measured(build_workings([leg]), leg, (0.0, 30.0)).reached_share == 0.0
