"""Shortest ways, against lengths that are known by geometry."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from minexplore.physics.robot import RobotParams
from minexplore.tasks.ways import WayField, ways_in
from minexplore.world import load_world
from tests.mines import BuiltMine

CELL_M = 0.25


def open_ground(free):
    """Return a world of cells that are free (rows, columns), far from rock, or rock."""
    return SimpleNamespace(
        folder=Path("ground"),
        record={"spawn": {"anchor_m": [1.0, 1.0]}},
        clearance_m=np.where(free, 5.0, 0.0),
        origin_m=np.zeros(2),
        cell_m=CELL_M,
        volume=None,
    )


def far(ways, start_m, end_m):
    """Return the way between two points of the plan."""
    number, _ = ways.nearest(np.array([*end_m, 0.0]))
    return WayField(ways, number).left_m(np.array([*start_m, 0.0]))


def test_on_open_ground_the_way_is_straight_within_its_stated_error_in_every_direction():
    ways = ways_in(open_ground(np.ones((200, 200), bool)), RobotParams())
    field = WayField(ways, ways.nearest(np.array([25.1, 25.1, 0.0]))[0])
    middle = ways.places_m[field.place]
    for angle in np.linspace(0, 2 * np.pi, 73):
        point = middle + 20.0 * np.array([np.cos(angle), np.sin(angle), 0.0])
        assert 20.0 - 1e-3 <= field.left_m(point) <= 20.0 * 1.014 + 0.02


def test_a_wall_is_gone_round_by_the_length_of_the_taut_string():
    free = np.ones((160, 160), bool)
    free[78:82, 20:140] = False  # a wall, from 5 to 35 m, 19.5 to 20.5 m up
    ways = ways_in(open_ground(free), RobotParams())
    want = 2 * np.hypot(15.0, 9.5) + 1.0  # from the middle below it to the middle above it
    assert far(ways, (20.0, 10.0), (20.0, 30.0)) == pytest.approx(want, rel=0.02)


def test_ways_do_not_depend_on_how_far_a_field_grew_before():
    rng = np.random.default_rng(0)
    ways = ways_in(open_ground(rng.uniform(size=(120, 120)) > 0.3), RobotParams())
    place = len(ways.places_m) // 2
    at_once, little = WayField(ways, place), WayField(ways, place)
    at_once.between(0.0, np.inf)
    for near in range(0, 30, 3):
        little.between(near, near + 3)
    for number in rng.choice(len(ways.places_m), 40):
        assert at_once.left_m(ways.places_m[number]) == little.left_m(ways.places_m[number])


def test_the_places_of_a_way_lead_to_its_end_by_its_length():
    free = np.ones((160, 160), bool)
    free[78:82, 20:140] = False
    ways = ways_in(open_ground(free), RobotParams())
    end, start = (ways.nearest(np.array([*point, 0.0]))[0] for point in ((20.0, 30.0), (20.0, 10.0)))
    field = WayField(ways, end)
    passed = field.way(ways.places_m[start])
    steps = np.linalg.norm(np.diff(ways.places_m[passed], axis=0), axis=1)
    assert (passed[0], passed[-1]) == (start, end)
    assert steps.sum() == pytest.approx(field.left_m(ways.places_m[start]), rel=1e-5)
    assert steps.max() <= np.hypot(3, 2) * CELL_M + 1e-6


def test_a_place_in_rock_has_no_way(tee: BuiltMine):
    ways = ways_in(load_world(tee.bundle), RobotParams())
    field = WayField(ways, 0)
    assert field.left_m(np.array([-50.0, -50.0, 0.0])) == np.inf
    assert len(field.way(np.array([-50.0, -50.0, 0.0]))) == 0


def test_a_drift_with_a_corner_has_the_length_of_its_legs(tee: BuiltMine):
    ways = ways_in(load_world(tee.bundle), RobotParams())
    assert far(ways, (10.0, 2.5), (70.0, 2.5)) == pytest.approx(60.0, rel=0.01)
    corner = np.array([38.0 + 0.35, 5.0 - 0.35])  # of the free ground of a disc of 0.35 m, about
    want = np.hypot(*(corner - [10.0, 2.5])) + np.hypot(*(corner - [40.5, 35.0]))
    assert far(ways, (10.0, 2.5), (40.5, 35.0)) == pytest.approx(want, rel=0.02)


def test_over_a_ramp_the_way_counts_its_rise(ramp: Path):
    ways = ways_in(load_world(ramp), RobotParams())
    number, apart = ways.nearest(np.array([50.0, 0.0, 3.0]))
    assert apart < 0.5
    end = ways.places_m[number]
    start = ways.places_m[ways.nearest(np.array([10.0, 0.0, 0.0]))[0]]
    want = (20.0 - start[0]) + np.hypot(20.0, 3.0) + (end[0] - 40.0)
    assert WayField(ways, number).left_m(start) == pytest.approx(want, rel=0.015)


def test_the_way_to_a_floor_that_is_lower_leads_down_the_ramp(over: Path):
    ways = ways_in(load_world(over), RobotParams())
    high = ways.nearest(np.array([10.0, 0.0, 8.0]))[0]
    low = ways.places_m[ways.nearest(np.array([45.0, 0.0, 5.0]))[0]]
    want = 30.0 - ways.places_m[high, 0] + np.hypot(low[0] - 30.0, 8.0 - low[2])
    assert WayField(ways, high).left_m(low) == pytest.approx(want, rel=0.02)
