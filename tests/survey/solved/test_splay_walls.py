"""Walls from splays, and what stands in for walls that nobody measured."""

from pathlib import Path

import numpy as np
import pytest

from minesurveys.frames import Source
from minesurveys.solved.model import LegFlag, LegStyle, Passage, SolvedSurvey
from minesurveys.solved.node_links import read_node_links
from minesurveys.solved_surveys import survey_files
from pipeline.errors import InputError
from pipeline.survey.passages.relief import roofs_of, usual_roof_m
from pipeline.survey.passages.survey_leg import SurveyLeg
from pipeline.survey.solved.plan_view import plan_legs
from pipeline.survey.solved.splay_walls import (
    fill_down,
    fill_sides,
    heights_of,
    measured,
    usual_half_width_m,
)
from pipeline.survey.whole_survey import built_piece
from pipeline.volume.height_field.assumed_roofs import network_with_roofs
from tests.solved import read_passages

NAN = np.nan
ROW = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0]])


def test_the_longest_plumb_splay_measures_the_roof_and_the_floor():
    splays = [
        np.array([[0.1, 1.0, 0.2], [0, 0.2, -1.1], [0, 0.3, -0.9]]),
        None,
        np.array([[0.2, -1.2, 0], [0, 0, 0.8]]),
    ]
    np.testing.assert_allclose(heights_of(splays), [[NAN, 1.1], [NAN, NAN], [0.8, NAN]])
    walls = np.array([[1.0, 0.2, NAN, 1.1], [NAN] * 4, [0.5, NAN, 0.8, NAN]])
    assert usual_half_width_m([([0, 1, 2], walls)]) == pytest.approx(0.6)


def test_measured_sides_stay_and_others_are_interpolated_where_most_were_measured():
    walls = np.full((5, 4), NAN)
    walls[1, :2], walls[3, :2] = (1.0, 2.0), (2.0, 0.0)
    filled = fill_sides(walls, 0.7)
    np.testing.assert_allclose(filled.walls[:, :2], [[0.7, 0.7], [1, 2], [0.7, 0.7], [2, 0], [0.7, 0.7]])
    assert (filled.have(Source.ASSUMED), filled.have(Source.INTERPOLATED)) == (3, 0)
    assert fill_sides(np.full_like(walls, NAN), 0.7).have(Source.ASSUMED) == 5
    walls[0, :2] = 0.9
    filled = fill_sides(walls, 0.7)  # most stations were measured
    np.testing.assert_allclose(filled.walls[:, :2], [[0.9, 0.9], [1, 2], [1.5, 1], [2, 0], [2, 0]])
    assert (filled.have(Source.ASSUMED), filled.have(Source.INTERPOLATED)) == (0, 2)


def test_the_distance_down_is_linear_along_the_legs_and_the_same_for_all_legs_of_a_station():
    places = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0], [10, 30, 0], [0, 0, 50], [5, 0, 50]])
    one, two, apart = np.full((3, 4), NAN), np.full((2, 4), NAN), np.full((2, 4), NAN)
    one[0, 3], one[2, 3] = 1.0, 2.0
    rows, sources = fill_down([([0, 1, 2], one), ([1, 3], two), ([4, 5], apart)], places, {})
    assert [sources[node] for node in range(6)] == [2, 1, 2, 0, 0, 0]
    np.testing.assert_allclose(rows[0][1][:, 3], [1, 1.5, 2], atol=1e-6)
    np.testing.assert_allclose(rows[1][1][:, 3], [1.5, 1.5], atol=1e-6)
    np.testing.assert_allclose(rows[2][1][:, 3], 1.5, atol=1e-6)  # the median of the measured ones


def test_a_floor_that_nobody_measured_is_not_over_what_splays_reached():
    places = np.column_stack([10.0 * np.arange(5), np.zeros(5), np.zeros(5)])
    walls = np.full((5, 4), NAN)
    walls[[0, 2], 3] = 1.0, 2.0
    (filled,), sources = fill_down([(list(range(5)), walls)], places, {0: 9.0, 1: 1.2, 4: 3.0})
    assert filled[1][:, 3].tolist() == pytest.approx([1.0, 1.5, 2.0, 2.5, 3.0])  # 1: deep enough; 0: as measured
    assert [sources[k] for k in range(5)] == [Source.MEASURED, 1, Source.MEASURED, 1, 1]
    (filled,), _ = fill_down([([0, 1], np.full((2, 4), NAN))], places, {1: 0.7})
    assert filled[1][:, 3].tolist() == [0.0, 0.7]


def test_the_depth_of_a_chamber_is_not_carried_into_passages_that_nobody_measured():
    places = np.column_stack([10.0 * np.arange(7), np.zeros(7), np.zeros(7)])
    walls, ring = np.full((7, 4), NAN), np.full((4, 4), NAN)
    walls[:4, 3] = 1.0, 1.0, NAN, 5.0  # and none at three stations beyond the chamber
    (filled, loop), _ = fill_down([(list(range(7)), walls), ([3, 5, 6, 3], ring)], places, {})
    np.testing.assert_allclose(filled[1][:, 3], [1, 1, 3, 5, 1, 1, 1])
    np.testing.assert_allclose(loop[1][:, 3], [5, 1, 1, 5])


def test_nodes_and_links_are_a_survey_whose_width_must_be_stated(tmp_path):
    nodes, links = tmp_path / "cave_nodes.dat", tmp_path / "cave_links.dat"
    nodes.write_text("0 0 0\n10 0 0.5\n20 0 1.5\n10 9 0.5\n")
    links.write_text("1 2\n2 3\n2 4\n")
    survey = read_node_links(nodes)
    assert len(survey.centreline()) == 3
    assert survey_files(nodes) == [nodes, links]
    legs, crs = read_passages(nodes, 1.5)
    assert crs is None
    assert {name for leg in legs for name in leg.stations} == {"1", "2", "3", "4"}
    assert all((leg.walls_m == 1.5).all() for leg in legs)
    with pytest.raises(InputError, match=r"state the distance to the walls \(survey\.half_width_m, --half-width\)"):
        read_passages(nodes)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 9\n", r"link 1 joins 1 and 9; the nodes are 1 to 2"),
        ("1 x\n", "want 2 numbers"),
        ("", "holds no numbers"),
        ("1 nan\n", "want 2 numbers"),
    ],
)
def test_links_that_are_not_valid_are_refused(tmp_path, text, message):
    (tmp_path / "a_nodes.dat").write_text("0 0 0\n1 1 1\n")
    (tmp_path / "a_links.dat").write_text(text)
    with pytest.raises(InputError, match=message):
        read_node_links(tmp_path / "a_nodes.dat")


def test_nodes_without_links_are_refused(tmp_path):
    (tmp_path / "a_nodes.dat").write_text("0 0 0\n1 1 1\n")
    with pytest.raises(InputError, match=r"a_links\.dat: no such file"):
        read_node_links(tmp_path / "a_nodes.dat")


def test_four_zeros_are_a_section_that_nobody_measured():
    walls = measured(np.array([[0.0, 0, 0, 0], [0, 2, 0, 0], [1, 1, 1, np.nan]]))
    np.testing.assert_array_equal(walls, [[np.nan] * 4, [0, 2, 0, 0], [1, 1, 1, np.nan]])


def legs_with_roofs(*up, first=0):
    """Return one leg of stations with distances up, each 1 m over the floor."""
    heights = np.column_stack([np.zeros(len(up)), up, np.ones(len(up))])
    places = np.column_stack([10.0 * np.arange(len(up)), np.zeros(len(up))])
    return [SurveyLeg("1", [str(first + k) for k in range(len(up))], places, np.ones((len(up), 2)), heights)]


def test_roofs_are_interpolated_where_half_of_a_leg_was_measured_and_are_assumed():
    network = network_with_roofs(legs_with_roofs(0.4, NAN, 1.4, NAN), 3.5, 1.0)
    np.testing.assert_allclose(network.lrud_m[:, :, 2], [[0.4, 0.9], [0.9, 1.4], [1.4, 1.4]])
    assert network.roof_assumed.tolist() == [[False, True], [True, False], [False, True]]
    np.testing.assert_allclose(network_with_roofs(legs_with_roofs(NAN, NAN, 2.0), 3.5, 1.0).lrud_m[0, :, 2], 2.5)


def test_stations_without_a_measured_roof_get_the_usual_one_of_the_survey():
    legs = legs_with_roofs(*[0.4] * 6, 0.8, 0.8, 0.9, 22.0) + legs_with_roofs(NAN, NAN, first=20)
    assert usual_roof_m(legs) == pytest.approx(1.4)
    network = network_with_roofs(legs, 3.5, 1.0)
    np.testing.assert_allclose(network.lrud_m[-1, :, 2:], [[0.4, 1.0]] * 2)  # the median is over the floor
    assert network.roof_assumed[-1].all()
    np.testing.assert_allclose(network_with_roofs(legs, 3.5, 1.0, 2.2).lrud_m[-1, :, 2], 1.2)  # the stated one
    network = network_with_roofs(legs, 3.5, 1.0, 0.7)  # lower than the stations, 1 m over the floor
    np.testing.assert_allclose(network.lrud_m[-1, :, 2:], [[0, 1]] * 2)
    legs = legs_with_roofs(*[22.0] * 9) + legs_with_roofs(NAN, NAN, first=20)  # few say nothing of the others
    assert usual_roof_m(legs) is None
    np.testing.assert_allclose(network_with_roofs(legs, 3.5, 1.0).lrud_m[-1, :, 2], 2.5)


def test_of_passages_that_share_a_station_the_tallest_says_how_high_it_is():
    low, high = legs_with_roofs(1.0, 2.0), legs_with_roofs(5.0, NAN)
    assert roofs_of(low + high) == roofs_of(high + low) == {"0": 6.0, "1": 3.0}


def test_a_survey_without_distances_down_has_a_usual_roof_too():
    (leg,) = legs_with_roofs(*[2.0] * 10, NAN)
    leg.heights_m[:, 2] = NAN
    assert usual_roof_m([leg]) == 2.0


def test_legs_without_a_section_are_built_and_go_on_as_the_passages_that_they_continue():
    # A passage of three stations; a leg on from its end, drawn from far to near, one off its middle, and one of splays.
    places = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0], [30, 0, 0], [10, 9, 1], [10, -9, 0], [10, -10.5, 0]])
    legs = np.array([[0, 1], [1, 2], [3, 2], [1, 4], [1, 5], [5, 6]])
    flags = np.array([0, 0, 0, 0, 0, LegFlag.SPLAY], np.uint8)
    passage = Passage(np.array([0, 1, 2]), np.array([[1.0, 2, 3, 0.5]] * 3))
    survey = SolvedSurvey(
        tuple("abcdefg"), places, np.zeros(7, np.uint8), legs, flags, np.zeros(6, np.uint8), (passage,)
    )
    found = {frozenset((leg.stations[0], leg.stations[-1])): leg for leg in plan_legs(Path("cave.3d"), survey, 0.8)}
    assert set(found) == {frozenset(pair) for pair in ("ac", "cd", "be")} | {frozenset(("b", "f and 1.50 m on"))}
    on = found[frozenset("cd")]
    sides = [1.0, 2.0] if on.stations == ["c", "d"] else [2.0, 1.0]
    np.testing.assert_allclose(on.walls_m, [sides, sides])
    assert sorted(on.heights_m[:, 1:].tolist()) == [[3, 0.5], [pytest.approx(NAN, nan_ok=True), 0.5]]
    np.testing.assert_allclose(found[frozenset("be")].walls_m, 0.8)
    assert {tuple(row) for row in found[frozenset("be")].heights_m[:, [0, 2]]} == {(0, 0.5), (1, 0.5)}
    assert found[frozenset(("b", "f and 1.50 m on"))].surveyed.sum() == 2  # a splay ahead of its end is its face


def test_a_section_of_one_station_is_that_of_the_legs_that_end_there():
    places = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0]])
    alone = Passage(np.array([0]), np.array([[3.0, 3, 4, 1]]))
    one, two = np.zeros(3, np.uint8), np.zeros(2, np.uint8)
    survey = SolvedSurvey(tuple("abc"), places, one, np.array([[0, 1], [1, 2]]), two, two, (alone,))
    (leg,) = plan_legs(Path("cave.3d"), survey, 0.8)
    assert leg.stations == ["a", "b", "c"]
    np.testing.assert_allclose(leg.walls_m, [[3, 3], [0.8, 0.8], [0.8, 0.8]])  # one in three says nothing of the others
    np.testing.assert_allclose(leg.heights_m[:, 1:], [[4, 1], [np.nan, 1], [np.nan, 1]])


def test_a_leg_that_goes_on_from_a_passage_has_its_section_there_however_long_it_is():
    places = np.array([[10.0 * k, 0, 0] for k in range(6)])
    passage = Passage(np.array([0, 1]), np.array([[3.0, 4, 5, 1]] * 2))
    legs = np.array([[k, k + 1] for k in range(5)])
    survey = SolvedSurvey(tuple("abcdef"), places, np.zeros(6, np.uint8), legs, *np.zeros((2, 5), np.uint8), (passage,))
    found = next(leg for leg in plan_legs(Path("cave.3d"), survey, 0.8) if "f" in leg.stations)
    walls = dict(zip(found.stations, found.walls_m.tolist(), strict=True))
    assert sorted(walls["b"]) == [3, 4]
    assert walls["c"] == walls["f"] == [0.8, 0.8]


def test_what_a_survey_leaves_open_is_listed_with_its_count(tmp_path, capsys):
    places = np.array([[10.0 * k, 0, 2.0 * k] for k in range(5)])
    walls = np.array([[1.0, 2, 3, 0.5], [NAN, 2, NAN, 0.5], [1, NAN, 3, NAN], [1, 2, NAN, 0.5]])
    legs = np.array([[k, k + 1] for k in range(4)])
    styles = np.array([0, 0, 0, LegStyle.NOSURVEY], np.uint8)
    passage = Passage(np.array([0, 1, 2, 3]), walls)
    survey = SolvedSurvey(
        tuple("abcde"), places, np.zeros(5, np.uint8), legs, np.zeros(4, np.uint8), styles, (passage,)
    )
    built_piece(Path("cave.3d"), survey, plan_legs(Path("cave.3d"), survey), None)
    told = capsys.readouterr().err
    for line in (
        "1 legs were not surveyed (nosurvey) and are built as straight passages, the longest 10.2 m from d to e",
        "3 of 6 stations of passages lack a wall on a side that most stations of their passage have",
        "2 of 5 stations have no measured distance down to the floor; it is interpolated along the legs",
        "2 of 5 stations have no measured roof, but most of their passage",
        "1 of 5 stations have no measured roof; compile3d.height_m over the floor is taken",
    ):
        assert line in told
