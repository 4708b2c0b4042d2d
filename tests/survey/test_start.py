"""Where robots start: a place that the user states, or the first with room."""

import numpy as np
import pytest

from minesurveys.frames import Heights
from pipeline.errors import InputError
from pipeline.geometry.maps.occupancy import first_anchor
from pipeline.survey.start import start_in_plan
from pipeline.types import Occupancy
from tests.composed import compose

# A level drift at an elevation of 520 m.
DRIFT = Heights(lines=[[(0.0, 0.0, 20.0), (60.0, 0.0, 20.0)]], datum_m=500.0)


def test_a_start_with_the_elevation_of_its_drift_is_a_place_of_the_plan():
    assert start_in_plan((30.0, 1.0, 521.0), DRIFT) == (30.0, 1.0)


def test_a_start_without_an_elevation_is_one_too():
    assert start_in_plan((30.0, 1.0), DRIFT) == start_in_plan((30.0, 1.0), None) == (30.0, 1.0)


@pytest.mark.parametrize("start", [(30.0, 1.0, 600.0), (900.0, 1.0, 500.0)])
def test_a_start_far_from_every_drift_is_refused_with_its_key(start):
    with pytest.raises(InputError, match=r"^survey\.entrance_m = .*: no drift within 20 m"):
        start_in_plan(start, DRIFT)


def test_an_elevation_in_a_level_mine_is_refused():
    with pytest.raises(InputError, match="an elevation needs a survey whose drifts have them"):
        start_in_plan((0.0, 0.0, 5.0), None)


def test_robots_start_at_the_first_place_with_room():
    free = np.zeros((40, 200), bool)
    free[10:30, 100:] = True
    clearance = np.where(free, 2.0, 0.0)
    grid = Occupancy(free, clearance, (0.0, 0.0), 0.5)
    spawn = first_anchor(grid, [(5.0, 10.0), (75.0, 10.0)], 10.0, 1.0)
    assert spawn.centre_m == (75.0, 10.0)


@pytest.mark.parametrize("value", ["[1.0,2.0]", "[1.0,2.0,3.0]"])
def test_a_start_is_two_or_three_numbers(value):
    assert list(compose([f"survey.entrance_m={value}"]).survey.entrance_m) == [float(v) for v in value[1:-1].split(",")]
