"""Legs of level surveys are as wide as they were measured, and bends do not narrow them."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from benchmarks.worlds.random_bends import KEPT, KINDS, judge, least_share, robots_parts
from pipeline.survey.passages.sections import sections_of, widths_kept
from pipeline.survey.passages.survey_leg import SurveyLeg, shots_of
from pipeline.survey.passages.workings import build_workings


def leg_of(places, walls=(2.0, 2.0)):
    places = np.array(places, float)
    walls = np.broadcast_to(np.array(walls, float), (len(places), 2)).copy()
    return SurveyLeg("1", [f"s{k}" for k in range(len(places))], places, walls)


def test_a_crosscut_of_ten_metres_between_long_drifts_keeps_its_four_metres():
    leg = leg_of([(0, 0), (60, 0), (60, 10), (0, 10)])
    free = build_workings([leg])
    assert least_share(leg, free) > 0.9999
    assert robots_parts(free) == 1


def test_a_square_bend_is_two_bands_and_a_quarter_of_a_disc_outside():
    free = build_workings([leg_of([(0, 0), (20, 0), (20, 30)])])
    bands, inner_corner, ends = 4 * 20 + 4 * 30, 4.0, np.pi * 4
    assert free.area == pytest.approx(bands - inner_corner + np.pi + ends, abs=0.03)  # arcs are polygons


def test_the_wall_outside_a_bend_is_as_far_from_the_station_as_it_was_measured():
    leg = leg_of([(0, 0), (20, 0), (20, 30)], (0.0, 3.0))  # turns left, and stands at the left wall
    free = build_workings([leg])
    angle = np.radians(np.linspace(-85, -5, 9))
    around = leg.positions_m[1] + 2.98 * np.column_stack([np.cos(angle), np.sin(angle)])
    assert shapely.contains_xy(free, *around.T).all()
    assert not shapely.contains_xy(free, 20 + 3.01 * np.cos(angle), 3.01 * np.sin(angle)).any()
    assert robots_parts(free) == 1


def test_a_bend_is_the_same_in_one_leg_and_between_two():
    leg = leg_of([(0, 0), (20, 0), (15, 30), (40, 10)], (1.0, 3.0))
    whole, parted = build_workings([leg]), build_workings(shots_of(leg))
    assert whole.symmetric_difference(parted).area < 1e-6


def test_a_bend_that_costs_little_width_has_one_section_and_no_corner():
    leg = leg_of([(0, 0), (10, 0), (10 + 10 * np.cos(0.3), 10 * np.sin(0.3))])
    across, _ = sections_of(leg.positions_m, leg.walls_m)
    np.testing.assert_allclose(across[0, 1], across[1, 0])
    np.testing.assert_allclose(across[0, 1], (-np.sin(0.15), np.cos(0.15)), atol=1e-12)
    assert widths_kept(leg.positions_m, leg.walls_m, across).min() == pytest.approx(np.cos(0.15), abs=1e-3)


def test_a_section_that_leans_over_a_short_leg_beside_a_long_one_is_not_shared():
    leg = leg_of([(0, 0), (100, 0), (100 + 5 * np.cos(0.5), 5 * np.sin(0.5))])
    across, _ = sections_of(leg.positions_m, leg.walls_m)
    np.testing.assert_allclose(across[0, 1], (0, 1), atol=1e-12)
    np.testing.assert_allclose(across[1, 0], (-np.sin(0.5), np.cos(0.5)), atol=1e-12)


def test_the_width_that_a_shared_section_keeps_is_what_is_built():
    rng = np.random.default_rng(3)
    for _ in range(40):
        bend = rng.uniform(-0.5, 0.5)
        leg = leg_of([(0, 0), (6, 0), (6 + 8 * np.cos(bend), 8 * np.sin(bend))], rng.uniform(0.5, 2, (3, 2)))
        shared = np.diff(leg.positions_m, axis=0)
        own = np.column_stack([-shared[:, 1], shared[:, 0]]) / np.linalg.norm(shared, axis=1)[:, None]
        across = np.stack([own, own], axis=1)
        chord = leg.positions_m[2] - leg.positions_m[0]
        across[0, 1] = across[1, 0] = np.array([-chord[1], chord[0]]) / np.hypot(*chord)
        stated = float(widths_kept(leg.positions_m, leg.walls_m, across).min())
        corners = np.stack([leg.positions_m[:-1], leg.positions_m[1:]], axis=1)
        walls = np.stack([leg.walls_m[:-1], leg.walls_m[1:]], axis=1)
        left, right = corners + across * walls[..., :1], corners - across * walls[..., 1:]
        quads = [shapely.Polygon([*left[k], *right[k, ::-1]]) for k in (0, 1)]
        assert least_share(leg, shapely.union_all(quads).buffer(1e-9)) <= min(stated, 1.0) + 3e-3


@pytest.mark.parametrize("kind", KINDS)
def test_random_traverses_are_as_wide_as_surveyed_and_in_one_part(kind):
    for seed in range(6):
        share, parts = judge(kind, seed)
        assert share >= KEPT
        assert parts == 1


def test_a_station_without_walls_parts_the_workings_as_the_survey_states():
    leg = leg_of([(0, 0), (20, 0), (40, 5)])
    leg = replace(leg, walls_m=np.array([[2.0, 2.0], [0.0, 0.0], [2.0, 2.0]]))
    assert robots_parts(build_workings([leg])) == 2
