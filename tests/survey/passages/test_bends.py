"""Legs of level surveys are as wide as they were measured, and bends do not narrow them."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pipeline.survey.passages.legs import SurveyLeg, shots_of
from pipeline.survey.passages.sections import sections_of, widths_kept
from pipeline.survey.passages.workings import build_workings

ROBOT_M = 0.35
KEPT = 0.95


def leg_of(places, walls=(2.0, 2.0)):
    places = np.array(places, float)
    walls = np.broadcast_to(np.array(walls, float), (len(places), 2)).copy()
    return SurveyLeg("1", [f"s{k}" for k in range(len(places))], places, walls)


def traverse(rng, walls):
    """Return a leg of 3 to 8 shots of 5 to 100 m that turn by 20 to 160 deg, which does not cross itself."""
    while True:
        turns = rng.choice([-1, 1], rng.integers(2, 8)) * np.radians(rng.uniform(20, 160))
        heading = np.cumsum([rng.uniform(0, 2 * np.pi), *turns])
        steps = rng.uniform(5, 100, len(heading))[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
        places = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        if shapely.LineString(places).is_simple:
            return leg_of(places, walls(rng, len(places)))


def least_share(leg, free):
    """Return the least share of the survey's section, every 0.25 m along a leg, that is free in one stretch."""
    least = 1.0
    for (start, end), (near, far) in zip(
        zip(leg.positions_m, leg.positions_m[1:], strict=False),
        zip(leg.walls_m, leg.walls_m[1:], strict=False),
        strict=True,
    ):
        step = end - start
        length = float(np.hypot(*step))
        left = np.array([-step[1], step[0]]) / length
        share = np.linspace(1e-3, 1 - 1e-3, max(3, int(length / 0.25)))[:, None]
        middle, walls = start + share * step, (1 - share) * near + share * far
        sections = np.stack([middle + left * walls[:, :1], middle - left * walls[:, 1:]], axis=1)
        parts, of = shapely.get_parts(shapely.intersection(shapely.linestrings(sections), free), return_index=True)
        widest = np.zeros(len(share))
        np.maximum.at(widest, of, shapely.length(parts))
        least = min(least, float((widest / walls.sum(axis=1)).min()))
    return least


def robots_parts(free):
    """Return how many parts the middle of a robot can be in, without specks."""
    return sum(part.area > 0.01 for part in shapely.get_parts(free.buffer(-ROBOT_M)))


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


@pytest.mark.parametrize("kind", ["level", "uneven", "at a wall"])
def test_random_traverses_are_as_wide_as_surveyed_and_in_one_part(kind):
    walls = {
        "level": lambda rng, n: (2.0, 2.0),
        "uneven": lambda rng, n: rng.uniform(0.5, 3.0, (n, 2)),
        "at a wall": lambda rng, n: np.column_stack([np.zeros(n), rng.uniform(1.0, 4.0, n)]),
    }[kind]
    rng = np.random.default_rng(7)
    for _ in range(8):
        leg = traverse(rng, walls)
        free = build_workings([leg])
        assert least_share(leg, free) >= KEPT
        assert robots_parts(free) == 1


def test_a_station_without_walls_parts_the_workings_as_the_survey_states():
    leg = leg_of([(0, 0), (20, 0), (40, 5)])
    leg = replace(leg, walls_m=np.array([[2.0, 2.0], [0.0, 0.0], [2.0, 2.0]]))
    assert robots_parts(build_workings([leg])) == 2
