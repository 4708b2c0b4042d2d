"""Bends of volumes: the wall goes round the outside of a bend as far from its station as it was measured."""

import numpy as np
import pytest

from pipeline.geometry.raycast import RayCaster
from pipeline.survey.solved.plan_view import plan_legs
from pipeline.survey.solved.station_table import read_station_legs, survey_of_legs
from pipeline.volume.floors import solve_floors
from pipeline.volume.network import network_of
from tests.heights import HEADER

LEFT_M, RIGHT_M = 0.4, 2.5
ROWS = ("A,1,0,0", "A,2,20,0", "A,3,20,15")  # turns left by 90 deg


def ranges_round_the_bend(tmp_path, name_of_second):
    """Return the ranges (9,) m from the station at the bend to the wall outside it, at 40 % of the height."""
    path = tmp_path / "survey.csv"
    rows = [ROWS[0], ROWS[1], *([ROWS[1].replace("A,", "B,")] * (name_of_second == "B")), ROWS[2]]
    rows[-1] = rows[-1].replace("A,", f"{name_of_second},")
    path.write_text(HEADER + "".join(f"{row},{LEFT_M},{RIGHT_M},0,2.5,0\n" for row in rows))
    legs = plan_legs(path, survey_of_legs(path, read_station_legs(path, None)), None)
    network = network_of(legs, 3.0, 1.0)
    volume = solve_floors(network)
    bend = network.places_m[[name.endswith("2") for name in network.names].index(True)]
    angle = np.radians(np.linspace(-85, -5, 9))
    ways = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(9)])
    return RayCaster(volume.vertices[volume.faces]).cast(np.tile(bend + np.array([0, 0, 1.0]), (9, 1)), ways)


@pytest.mark.parametrize("second", ["A", "B"])
def test_the_wall_outside_a_bend_is_as_far_as_it_was_measured(tmp_path, second):
    ranges = ranges_round_the_bend(tmp_path, second)
    assert (ranges > 0.95 * RIGHT_M).all()
    assert (ranges < RIGHT_M + 0.01).all()
