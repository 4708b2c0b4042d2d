"""Floors have the survey's heights along legs, and legs share a floor where they are near in height."""

import numpy as np
import pytest

from benchmarks.comparisons.volume.cases import GateCase
from minexplore.floors.volume_arrays import FacetLabel
from pipeline.volume.floor_error import measure_floor
from pipeline.volume.floors import NEAR_M, solve_floors
from pipeline.volume.height_field.leg_lines import drop
from pipeline.volume.union import pieces_of, unite
from tests.heights import HEADER

OVER = "A,1,-20,0,2,2,0,3,0\nA,2,20,0,2,2,0,3,0\nB,3,0,-20,2,2,{z},3,0\nB,4,0,20,2,2,{z},3,0\n"
CROSSWAYS = """A,1,-12.3388,-5.0456,2.2,2.2,101.4345,3.5,0
A,2,-17.3339,9.2568,2.2,2.2,101.0375,3.5,0
A,3,-21.1095,21.4124,2.2,2.2,100.6569,3.5,0
B,4,-3.8856,12.4263,2.2,2.2,99.6134,3.5,0
B,2,-17.3339,9.2568,2.2,2.2,101.0375,3.5,0
C,2,-17.3339,9.2568,2.2,2.2,101.0375,3.5,0
C,5,-31.5668,4.5435,2.2,2.2,102.6259,3.5,0
"""


def of_rows(rows, folder):
    network = GateCase("test", HEADER + rows).network(folder)
    return network, unite(network, pieces_of(network))


def test_a_floor_beside_a_leg_on_its_wall_does_not_turn_about_it(tmp_path):
    # Two ways leave a station with one wall in common: their floors are 0.5 m apart where they are 8 cm beside it.
    rows = "A,1,0,0,0.08,4,0,3,0\nA,2,10,0,0.08,4,1,3,0\nB,1,0,0,3,0.08,0,3,0\nB,3,10,0.3,3,0.08,0.1,3,0\n"
    network, _ = of_rows(rows, tmp_path)
    volume = solve_floors(network)
    places = volume.vertices[np.unique(volume.faces[volume.label == FacetLabel.FLOOR])]
    assert places[:, 2].min() > -0.5
    assert places[:, 2].max() < 1.5
    assert measure_floor(volume, network).error_m < 0.01


def test_passages_that_cross_without_a_common_station_share_a_floor_where_they_are_near_in_height(tmp_path):
    network, _ = of_rows(OVER.format(z=0.4), tmp_path)
    volume = solve_floors(network)
    found = measure_floor(volume, network)
    assert max(found.error_m, found.step_m, found.other_step_m) < 0.01
    assert found.ledges == ()
    assert [(place.leg, place.other) for place in found.elsewhere] == [("3 to 4", "1 to 2")]
    assert found.elsewhere[0].off_m == pytest.approx(-0.4, abs=0.01)
    assert np.hypot(*found.elsewhere[0].place_m[:2]) < 0.3  # where their ways cross
    _, height = drop(volume.vertices, volume.faces, np.array([[0, y, 1.0] for y in (-1.5, -1.2, 1.2, 1.5)]))
    assert np.abs(height - 0.4).max() < 0.01  # the ramp is as steep as robots drive


def test_passages_that_cross_far_apart_in_height_keep_their_floors_and_the_hole_is_listed(tmp_path):
    network, _ = of_rows(OVER.format(z=0.6), tmp_path)
    volume = solve_floors(network)
    found = measure_floor(volume, network)
    assert max(found.error_m, found.step_m) < 0.01
    assert [(place.leg, place.other) for place in found.elsewhere] == [("3 to 4", "1 to 2")]
    assert found.elsewhere[0].off_m == pytest.approx(-0.6, abs=0.01)
    heights = volume.vertices[np.unique(volume.faces[volume.label == FacetLabel.FLOOR]), 2]
    assert np.minimum(np.abs(heights), np.abs(heights - 0.6)).max() < 0.005


def test_legs_are_near_each_other_along_the_survey_and_not_across_it(tmp_path):
    rows = OVER.format(z=0.0) + "C,2,20,0,2,2,0,3,0\nC,5,30,0,2,2,0,3,0\n"
    network, _ = of_rows(rows, tmp_path)
    near = network.near_legs(NEAR_M)
    names = [network.leg_name(k) for k in range(3)]
    one, other, beside = (names.index(name) for name in ("1 to 2", "3 to 4", "2 to 5"))
    assert near.has(np.array([one, one, one]), np.array([one, other, beside])).tolist() == [True, False, True]


def test_the_inner_corner_of_crossways_leaves_no_ledge_between_its_two_floors(tmp_path):
    network, _ = of_rows(CROSSWAYS, tmp_path)
    found = measure_floor(solve_floors(network), network)
    assert found.step_m < 0.01
    assert found.ledges == ()
