"""Which differences and steps of floors are measured against a survey."""

import dataclasses

import numpy as np
import pytest

from benchmarks.comparisons.volume.cases import GateCase
from benchmarks.comparisons.volume.random_volumes import table_of
from minexplore.floors.volume_arrays import FacetLabel
from pipeline.volume.floor_error import measure_floor
from pipeline.volume.floors import solve_floors
from pipeline.volume.height_field.leg_lines import drop
from pipeline.volume.union import STEEPEST, pieces_of, unite
from tests.heights import HEADER

# A level drift, and a ramp that falls by 4 m in 15 m and parts from it by 25 deg.
PARTING = "A,0,-10,0,2,2,0,3,0\nA,1,0,0,2,2,0,3,0\nA,2,15,0,2,2,0,3,0\nB,1,0,0,2,2,0,3,0\nB,3,13.6,6.34,2,2,-4,3,0\n"
# Three legs that rise from a station, whose prism is level, and a drift 5 cm over it that leaves from elsewhere.
OVER_A_STATION = (
    "A,j,0,0,4,4,0,3,0\nA,a,20,0,4,4,6,3,0\nB,j,0,0,4,4,0,3,0\nB,b,-10,17.3,4,4,6,3,0\n"
    "C,j,0,0,4,4,0,3,0\nC,c,-10,-17.3,4,4,6,3,0\n"
    "D,a,20,0,2,2,6,3,0\nD,e,30,-25,2,2,3,3,0\nD,f,0.5,-25,2,2,0.05,3,0\nD,g,0.5,9,2,2,0.05,3,0\n"
)
# A crawl, and a passage that crosses it 0.58 m higher on average and rises; no station is in both.
OVER_A_CRAWL = "A,1,0,-10,1,1,0,0.4,0\nA,2,0,10,1,1,0,0.4,0\nB,3,-10,0,1,1,-0.6,2,0\nB,4,10,0,1,1,1.8,2,0\n"
# A wide chamber at the foot of a slope, and a passage over it that ends on the slope. From a real cave.
OVER_A_CHAMBER = (
    "A,a,2.3,2.7,2,3,-0.4,3.2,2\nA,b,2.5,-0.2,2,3,-0.5,3,1\n"
    "B,c,34.7,-11.9,0.5,0.9,3.3,0.2,2.5\nB,d,-0.4,-0.5,1.2,6,-0.2,2.3,0.7\n"
    "C,e,7.7,-15.2,0,0.9,-1.9,0.2,0.1\nC,a,2.3,2.7,6,3,-0.4,3.2,2\n"
    "D,d,-0.4,-0.5,1.2,6,-0.2,2.3,0.7\nD,b,2.5,-0.2,2,3,-0.5,3,1\n"
)
# A leg too steep to drive on leads down to one of 0.1 m, and on. Likewise.
UNDER_A_STEEP_LEG = (
    "A,a,0.47,-3.69,0.08,0.99,2.39,6.42,1.26\nA,b,0.38,-0.38,0.35,0.07,0.37,10.5,0.84\n"
    "B,b,0.38,-0.38,0.35,0.07,0.37,10.5,0.84\nB,c,0.46,-0.33,0.5,0.51,-0.29,0.52,0.15\n"
    "C,c,0.46,-0.33,0.5,0.51,-0.29,0.52,0.15\nC,d,3.32,0.73,0.43,0.23,-0.34,0.21,0.92\n"
)
# Two legs at a station and one too steep to drive on that rises from it, whose level section is on a slope. Likewise.
ON_A_SLOPE = (
    "A,a,5.37,-3.93,1.8,0,-2.17,2,1.8\nA,b,0.12,-0.07,2.5,1.2,-0.43,4,2\n"
    "B,b,0.12,-0.07,2.5,1.2,-0.43,4,2\nB,c,0.41,-2.6,0,2.5,-1.16,4,1.5\n"
    "C,c,0.41,-2.6,0,2.5,-1.16,4,1.5\nC,d,-5.9,-2.56,1.5,1.4,2.64,5,1.3\n"
)
# A leg crosses over a low one; a third joins an end of each. Likewise.
OVER_A_LOW_LEG = (
    "A,a,4.1,-2.1,0,1,1.3,0.3,0.5\nA,b,0.3,0.4,2,0.5,0.3,0,0.5\n"
    "B,c,1.5,-2.8,2,1.5,-0.8,0.5,0.3\nB,d,3.3,3,2,0.2,1.4,0,0.6\n"
    "C,b,0.3,0.4,2,0.5,0.3,0,0.5\nC,d,3.3,3,2,0.2,1.4,0,0.6\n"
)
# A wide leg turns back over another of its station, and falls below it. Likewise.
UNDER_ITSELF = (
    "A,a,-17.4,23.2,1.5,12,-1.5,1.5,2\nA,b,-0.3,9.9,0,11,-2.2,8,2.5\n"
    "B,b,-0.3,9.9,0,11,-2.2,8,2.5\nB,c,-0.2,-0.4,2.5,9,0.2,2.5,2\nB,d,5,-12.1,6,7,0.4,1,2\n"
)
# Two stations over each other whose depths differ by 7 cm; two legs end at one, another begins at the other. Likewise.
TWO_DEPTHS = (
    "A,a,0.4,10,5,5,3.9,0,3\nA,b,0,0,3.5,1.2,0,1.8,1.8\nB,e,-3.3,2.6,0,1,0.1,3,1.7\nB,b,0,0,3.5,1.2,0,1.8,1.8\n"
    "C,b,0,0,3.5,1.2,0,1.8,1.8\nC,c,0,0,3.5,1.2,1.13,0.7,3\n"
    "D,c,0,0,3.5,1.2,1.13,0.7,3\nD,d,-2.1,-2.85,2.5,1,1.2,0.3,3\n"
)
# A passage that was surveyed twice: legs cross at 12 deg beside their ends, with floors 0.6 m apart. Likewise.
SURVEYED_TWICE = (
    "A,a,5.71,-2.18,1.2,0,0.06,0.587,1.413\nA,b,0,0,0,1.5,0,1.6,1.6\n"
    "B,b,0,0,0,1.5,0,1.6,1.6\nB,c,3.7,9.38,2.5,0,0.06,0.5,1.7\n"
    "C,c,3.7,9.38,2.5,0,0.06,0.5,1.7\nC,g,2.16,13.17,1.6,0,-0.23,1.2,1.1\n"
    "D,d,1.89,11.73,0.3,1.2,0.21,0.6,1.2\nD,e,-0.05,-0.41,2.5,0.2,-0.08,1.6,0.9\n"
    "E,e,-0.05,-0.41,2.5,0.2,-0.08,1.6,0.9\nE,f,4.71,-1.58,0.4,1,-0.06,1.5,0.8\n"
)
# A floor that steps up twice, by 0.4 and 0.3 m, and comes back over its beginning. As in a real cave.
TWO_STEPS_UP = (
    "A,a,-1.1,6.1,1.1,1.1,0,2.5,0.7\nA,b,0,0,1.1,1.1,0,2.5,0.7\nA,c,0,0,1.1,1.1,0.4,2.5,0.7\n"
    "A,d,1.3,-0.9,1.1,1.1,0.4,2.5,0.7\nA,e,1.3,-0.9,1.1,1.1,0.7,2.5,0.7\nA,f,1.55,-3.5,1.1,1.1,0.7,2.5,0.7\n"
    "A,g,-0.2,0.1,1.1,1.1,0.7,2.5,0.7\n"
)


# A floor steps up by 0.45 m between two stations that are 2 cm apart in plan, and goes back. Likewise.
STEP_OF_2_CM = (
    "A,a,-6.29,0.19,0.6,0.6,0.04,0.79,0.11\nA,b,0,-0.02,0.6,0.6,-0.45,0.79,0.11\nA,c,0,0,0.6,0.6,0,0.79,0.11\n"
    "A,d,2.9,-2.89,0.6,0.6,0.29,0.79,0.11\n"
)
# A passage ends in a chamber and other legs go on with its section; a third row comes up and leaves steeply. Likewise.
GOES_ON = (
    "A,a,-16.2,-1.33,2.96,1.86,-2.31,0,5.38\nA,b,0,0,2.96,1.86,0,5.14,5.38\nA,c,2.77,0.9,0.49,0.22,-0.76,0.68,0.54\n"
    "B,g,-12.7,-1.18,1.2,0.5,-3,2,0.4\nB,d,-7.71,-0.88,1.2,0.5,-2.97,2,0.4\nB,b,0,0,2.5,0.8,0,5,5.38\n"
    "C,b,0,0,2.5,0.8,0,5.14,5.38\nC,e,3.4,0.26,0.68,0.68,-0.78,0,5.38\nC,f,9.39,1.48,0.68,0.68,0.74,0,5.38\n"
)
# Two legs at a station whose floors are 2.01 m apart at the section where one ends, and pass a third there. Likewise.
PARTS_BY_1_CM = (
    "A,a,-3.386,7.028,5,1.45,-1.366,1.893,1.553\nA,b,0,0,2.002,5.179,0,8.255,0.744\n"
    "B,a,-3.386,7.028,5,1.45,-1.366,1.893,1.553\nB,c,3.831,-8.177,4.826,2.024,-1.185,0.229,1.382\n"
    "C,d,3.671,-10.709,0.297,0.297,-2.806,0.76,0.01\nC,e,-2.681,11.768,0.819,0.039,0.444,0.051,0.456\n"
    "D,c,3.831,-8.177,4.826,2.024,-1.185,0.229,1.382\nD,b,0,0,2.002,5.179,0,8.255,0.744\n"
)
# A wide leg passes another 0.51 m lower, as the sections state; smooth floors would be nearer. Likewise.
HARDLY_APART = (
    "A,a,-8.925,19.412,2.947,3.286,0.989,1.413,1.04\nA,b,-2.650,14.457,0,7.555,1.006,1.429,1.16\n"
    "A,c,2.020,10.394,0.02,0.709,-1.063,0.072,0.652\nA,d,2.417,8.306,2.504,5.087,-1.009,8.084,0.694\n"
    "A,e,0.000,0.000,0,2.299,0.000,4.507,0.375\n"
    "B,c,2.020,10.394,0.02,0.709,-1.063,0.072,0.652\nB,f,-3.631,-5.860,0.383,0.099,2.374,0.086,0.774\n"
    "C,d,2.417,8.306,2.504,5.087,-1.009,8.084,0.694\nC,e,0.000,0.000,0,2.299,0.000,4.507,0.375\n"
)


def built(table, folder):
    network = GateCase("test", table).network(folder)
    return network, unite(network, pieces_of(network))


def test_a_ledge_between_two_floors_that_a_robot_drives_on_is_a_step(tmp_path):
    network, rough = built(HEADER + PARTING.replace("-4", "-0.8"), tmp_path)  # a ledge of 0.5 m and more is a wall
    assert measure_floor(rough, network).step_m > 0.4
    assert measure_floor(solve_floors(network), network).step_m < 0.01


def test_the_end_of_a_ledge_between_floors_too_steep_to_drive_on_is_no_step(tmp_path):
    network, _ = built(table_of("cave", 15), tmp_path)
    assert measure_floor(solve_floors(network), network).step_m < 0.01


@pytest.mark.parametrize("seed", [31, 53, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (44, 76, 88))])
def test_a_leg_keeps_its_floor_where_the_floor_of_another_ends_or_begins_below_it(tmp_path, seed):
    network, _ = built(table_of("cave", seed), tmp_path)
    found = measure_floor(solve_floors(network), network)
    assert max(found.error_m, found.step_m, found.other_step_m) < 0.01


def test_a_passage_keeps_its_floor_over_a_crawl_that_it_does_not_meet(tmp_path):
    network, _ = built(HEADER + OVER_A_CRAWL, tmp_path)
    found = measure_floor(solve_floors(network), network)
    assert max(found.error_m, found.step_m, found.other_step_m) < 0.01


KNOTS = {
    "chamber": OVER_A_CHAMBER,
    "itself": UNDER_ITSELF,
    "steep": UNDER_A_STEEP_LEG,
    "slope": ON_A_SLOPE,
    "low": OVER_A_LOW_LEG,
    "depths": TWO_DEPTHS,
    "twice": SURVEYED_TWICE,
    "steps": TWO_STEPS_UP,
    "short": STEP_OF_2_CM,
    "on": GOES_ON,
    "slot": PARTS_BY_1_CM,
    "apart": HARDLY_APART,
}


@pytest.mark.parametrize("knot", KNOTS)
def test_legs_of_real_caves_that_meet_keep_their_floors_without_a_step(tmp_path, knot):
    network, _ = built(HEADER + KNOTS[knot], tmp_path)
    found = measure_floor(solve_floors(network), network)
    assert max(found.error_m, found.step_m, found.other_step_m) < 0.01
    assert found.share_built == 1


@pytest.mark.parametrize("low_m", [0.0, 0.1, 47.08, 100.1, 513.57])
def test_a_floor_that_steps_up_by_half_a_metre_and_turns_back_over_itself_is_one_floor(tmp_path, low_m):
    rows = [(-7.0, -0.5, 0), (-4.8, 3.1, 0), (-2.8, 0.03, 0), (0, 0, 0), (0, 0, 0.5), (3.5, 0.8, 0.5)]
    table = "".join(f"A,{k},{x},{y},1.1,1.1,{low_m + z:.2f},1.9,0\n" for k, (x, y, z) in enumerate(rows))
    network, _ = built(HEADER + table, tmp_path)
    found = measure_floor(solve_floors(network), network)
    assert max(found.error_m, found.step_m, found.other_step_m) < 0.01


def test_a_step_of_the_floor_may_be_3_mm_beside_where_it_was_surveyed_and_no_more(tmp_path):
    network, _ = built(HEADER + STEP_OF_2_CM, tmp_path)
    volume = solve_floors(network)
    for moved_m, most in ((0.001, True), (0.02, False)):
        beside = dataclasses.replace(volume, vertices=volume.vertices + np.array([0, -moved_m, 0]))
        assert (measure_floor(beside, network).error_m < 0.01) == most


def test_a_leg_that_comes_down_to_another_rises_from_it_as_steeply_as_robots_drive(tmp_path):
    rows = "A,1,0,-10,1,1,0,3,0\nA,2,0,10,1,1,0,3,0\nB,3,-10,-0.3,2,2,0.4,3,0\nB,4,10,0.3,2,2,0.4,3,0\n"
    network, _ = built(HEADER + rows, tmp_path)
    volume = solve_floors(network)
    places = network.floors_m[1, 0] + np.linspace(0.4, 0.6, 41)[:, None] * (
        network.floors_m[1, 1] - network.floors_m[1, 0]
    )
    height = drop(volume.vertices, volume.faces, places + np.array([0, 0, 0.1]))[1]
    ramp = np.minimum(0.4, STEEPEST * np.linalg.norm(places[:, :2] - places[20, :2], axis=1))
    assert height - places[20, 2] + 0.4 == pytest.approx(ramp, abs=0.01)
    assert measure_floor(volume, network).error_m < 0.01
    lower = volume.vertices.copy()
    lower[lower[:, 2] < network.floors_m[:, :, 2].min() + 0.5, 2] -= 0.03
    found = measure_floor(dataclasses.replace(volume, vertices=lower), network)
    assert found.error_m == pytest.approx(0.03, abs=0.01)


def test_a_leg_comes_down_to_two_others_that_are_near_each_other(tmp_path):
    rows = "A,1,-1,-8,1,1,0,3,0\nA,2,-1,8,1,1,0,3,0\nB,3,1,-8,1,1,0,3,0\nB,4,1,8,1,1,0,3,0\n"
    rows += "C,5,-10,0.5,2,2,0.45,3,0\nC,6,10,-0.5,2,2,0.45,3,0\n"
    network, _ = built(HEADER + rows, tmp_path)
    found = measure_floor(solve_floors(network), network)
    assert {(one.leg, one.other) for one in found.elsewhere} >= {("5 to 6", "1 to 2"), ("5 to 6", "3 to 4")}
    assert max(found.error_m, found.step_m) < 0.01


def test_the_foot_of_a_shaft_is_one_floor_with_the_narrower_drifts_that_leave_it(tmp_path):
    drifts = "A,1,10,0,1,1,1.5,2,0\nA,2,0,0,1,1,0,2,0\nB,2,0,0,1,1,0,2,0\nB,3,-8,3,1,1,1,2,0\n"
    shaft = "S,2,0,0,3,3,0,9,0\nS,4,0,0,3,3,9,2,0\nC,4,0,0,1,1,9,2,0\nC,5,10,0,1,1,9,2,0\n"
    network, _ = built(HEADER + drifts + shaft, tmp_path)
    volume = solve_floors(network)
    level = -volume.normals[:, 2] > 0.7 * np.linalg.norm(volume.normals, axis=1)
    assert (volume.label[level] == FacetLabel.FLOOR).all()
    corners = volume.vertices[volume.faces[level]][:, :, :2] - network.places_m[1, :2]
    assert np.linalg.norm(corners, axis=2)[corners[:, :, 1].min(axis=1) < -2.5].min() < 4  # beside the drifts, too
    found = measure_floor(volume, network)
    assert max(found.error_m, found.step_m) < 0.01


def test_a_steep_way_goes_on_down_past_a_drift_that_leaves_it(tmp_path):
    rows = "A,1,0,0,1,1,0,3,0\nA,2,10,0,1,1,-5,3,0\nA,3,20,0,1,1,-10,3,0\nB,2,10,0,1,1,-5,3,0\nB,4,10,10,1,1,-5,3,0\n"
    network, _ = built(HEADER + rows, tmp_path)
    assert network.joined[0, 1]  # both steep legs are one tube
    assert measure_floor(solve_floors(network), network).share_built == 1


def test_a_leg_with_a_flat_floor_is_no_shaft_however_its_stations_lie(tmp_path):
    roof_to_floor = "A,1,0,0,2,2,2,1,2\nA,2,1.5,0,2,2,0.2,1,0\nA,3,12,0,2,2,0.2,1,0\n"
    network, rough = built(HEADER + roof_to_floor, tmp_path)
    assert abs(network.ends_m[0, 1, 2] - network.ends_m[0, 0, 2]) > 1.5
    assert rough.pieces[0].is_drivable
    assert not rough.pieces[0].is_plumb
    found = measure_floor(solve_floors(network), network)
    assert max(found.error_m, found.step_m) < 0.01
    assert found.over_floor == 1


def test_the_largest_error_and_step_name_the_legs_and_the_place(tmp_path):
    network, rough = built(HEADER + PARTING, tmp_path)
    found = measure_floor(rough, network)
    assert "1 to 3" in found.step_at.legs
    ledge = next(ledge for ledge in found.ledges if ledge.step_m == found.step_m)
    assert ledge.meet
    assert found.step_at.place_m == ledge.place_m
    volume = solve_floors(network)
    places = volume.vertices.copy()
    floor = np.unique(volume.faces[volume.label == FacetLabel.FLOOR])
    places[floor[places[floor, 0] < places[:, 0].min() + 0.01], 2] -= 0.3  # at the end of the first leg
    at = measure_floor(dataclasses.replace(volume, vertices=places), network).error_at
    assert at.legs == "0 to 1"
    assert at.place_m[0] == pytest.approx(network.places_m[0, 0], abs=0.01)


def test_a_leg_over_the_deeper_prism_of_a_station_elsewhere_lies_in_that_working(tmp_path):
    network, rough = built(HEADER + OVER_A_STATION, tmp_path)
    found = measure_floor(rough, network)
    over_prism = sum(place.share for place in found.elsewhere if place.leg == "f to g")
    assert over_prism > 0.15  # 8 m of 34 m


def test_a_leg_along_its_own_wall_is_judged_by_its_own_floor(tmp_path):
    beside = "A,1,0,0,0,4,0,3,0\nA,2,20,0,0,4,0,3,0\nB,3,2,1,1,1,0.09,3,0\nB,4,18,1,1,1,0.09,3,0\n"
    network, _ = built(HEADER + beside, tmp_path)
    found = measure_floor(solve_floors(network), network)
    assert found.error_m < 0.01
    assert found.elsewhere == ()
    assert found.share_built == 1


def test_rock_is_put_before_a_thin_wall_where_no_leg_runs(tmp_path):
    beside = "A,1,0,0,0,4,0,3,0\nA,2,20,0,0,4,0,3,0\nB,3,0,1.01,1,1,0,3,0\nB,4,20,1.01,1,1,0,3,0\n"
    network, rough = built(HEADER + beside, tmp_path)
    volume = solve_floors(network)
    assert len(volume.solid.decompose()) == 2
    assert volume.solid.volume() < rough.solid.volume() - 20 * 0.04
    assert measure_floor(volume, network).share_built == 1


def test_a_steep_leg_between_skew_sections_is_free_along_its_way(tmp_path):
    skew = "A,1,-6,-1,1,1,0,1,0.5\nA,2,0,0,2.5,1.6,0,1,0.5\nA,3,4.7,0,0.3,2.4,3.7,1,0.5\n"
    network, rough = built(HEADER + skew, tmp_path)
    assert network.joined[1, 0]
    assert not rough.pieces[1].is_drivable
    assert measure_floor(rough, network).share_built == 1


def test_wheels_beside_a_leg_are_on_the_stated_floor_and_a_bank_between_two_legs_is_steep(tmp_path):
    network, _ = built(HEADER + "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,2,3,0\n", tmp_path)
    found = measure_floor(solve_floors(network), network)
    assert found.tracks_m < 0.01
    assert found.steepest == pytest.approx(0.1, abs=0.01)
    network, _ = built(HEADER + PARTING, tmp_path)
    assert measure_floor(solve_floors(network), network).tracks_m > found.tracks_m
