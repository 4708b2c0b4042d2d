"""How distances of a survey are known, from its file to the map, the long section and the 3D view."""

import numpy as np
import pytest

from minesurveys.frames import Source
from pipeline.report.chart import ChartGrid
from pipeline.survey.passages.legs import legs_of
from pipeline.survey.passages.relief import known_of
from pipeline.volume.leg_charts import (
    facets_by_known,
    measured_widths_m,
    quads_from_above,
    section_chart,
    shares_known,
    shown_stations,
)
from pipeline.volume.network import SurveyNetwork, network_of
from tests.volume_worlds import HEADER, legs_of_table

# In leg A two of three stations have walls and a roof, in leg B one of four; 5 has its floor between 3 and 6.
TABLE = HEADER + (
    "A,1,0,0,100,2,1,3,0.2\nA,2,30,0,99,,,,0.2\nA,3,60,0,96,2,1,3,0.2\n"
    "B,3,60,0,96,2,1,3,0.2\nB,4,90,0,97,,,,\nB,5,120,0,98,,,,\nB,6,150,0,99,,,,0.4\n"
)
M, BETWEEN, GUESS = Source.MEASURED, Source.INTERPOLATED, Source.ASSUMED


@pytest.fixture(scope="module")
def surveyed(tmp_path_factory):
    return legs_of_table(TABLE, tmp_path_factory.mktemp("known"))


@pytest.fixture
def legs():
    """Return two legs of 10 m in a row, 3 m wide; at their middle station the left wall and the roof are assumed."""
    places, shots = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0]]), np.array([[0, 1], [1, 2]])
    known = np.full((2, 2, 4), M, np.uint8)
    known[0, 1, [0, 2]] = known[1, 0, [0, 2]] = GUESS
    across, lrud = np.tile([0.0, 1.0], (2, 2, 1)), np.tile([2.0, 1.0, 2.0, 0.5], (2, 2, 1))
    none = np.zeros((2, 2), bool)
    return SurveyNetwork(places, shots, across, lrud, none, known, none, ("1", "2", "3"))


def test_a_station_says_of_each_distance_whether_it_is_measured_interpolated_or_assumed(surveyed):
    first, second = legs_of(surveyed)
    assert known_of(first).tolist() == [[M] * 4, [BETWEEN, BETWEEN, BETWEEN, M], [M] * 4]
    assert known_of(second).tolist() == [
        [M] * 4,
        [GUESS, GUESS, GUESS, BETWEEN],
        [GUESS, GUESS, GUESS, BETWEEN],
        [GUESS, GUESS, GUESS, M],
    ]


def test_a_network_knows_it_at_both_ends_of_each_leg_whichever_way_its_chains_run(surveyed):
    network = network_of(legs_of(surveyed), 3.0, 1.0)
    names = [network.names[n] for n in network.shots.ravel()]
    at = set(zip(names, map(tuple, network.known.reshape(-1, 4).tolist()), strict=True))
    known = dict(at)
    assert len(at) == len(known) == 6
    assert known["2"] == (BETWEEN, BETWEEN, BETWEEN, M)
    assert known["4"] == (GUESS, GUESS, GUESS, BETWEEN)
    assert network.roof_assumed.tolist() == [[row[2] != M for row in ends] for ends in network.known.tolist()]


def test_the_headline_counts_stations_where_both_walls_are_measured_and_their_widths_alone(legs):
    widths, count = measured_widths_m(legs)
    assert (widths.tolist(), count) == ([3.0, 3.0], 3)


def test_shares_count_each_half_of_a_leg_as_the_station_at_its_end(legs):
    shares = shares_known(legs)
    assert shares["walls"] == pytest.approx((0.75, 0, 0.25))
    assert shares["roof"] == pytest.approx((0.5, 0, 0.5))
    assert shares["floor"] == pytest.approx((1, 0, 0))


def test_the_map_has_a_quad_for_each_half_and_side_of_a_leg(legs):
    quads = np.array(quads_from_above(legs))
    middle = quads[:, :8].reshape(-1, 4, 2).mean(axis=1)
    near = np.abs(middle[:, 0] - 10) < 5
    assert len(quads) == 8
    assert ((quads[:, 8] == GUESS) == (near & (middle[:, 1] > 0))).all()
    assert ((quads[:, 9] == GUESS) == near).all()
    x, y = np.moveaxis(quads[:, :8].reshape(-1, 4, 2), 2, 0)
    area = np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)) / 2
    assert area.sum() == pytest.approx(20 * 3)


def test_the_long_section_has_elevations_and_the_roof_over_the_survey_line(legs):
    chart, bearing = section_chart(legs, 100.0, shown_stations(legs, 100.0, ChartGrid()))
    assert bearing == pytest.approx(90)
    assert chart.bounds == pytest.approx((0, 99.5, 20, 102))
    quads = np.array(chart.quads)
    roof = quads[:, :8].reshape(-1, 4, 2)[:, :, 1].max(axis=1) > 100
    assert roof.sum() == 4
    assert (quads[roof, 8] == GUESS).sum() == 2
    assert (quads[~roof, 8] == M).all()


def test_facets_are_cut_between_two_stations_and_known_as_the_nearer_one(legs):
    x0, x1 = 0.0, 10.0
    floor = [[[x0, -1, -0.5], [x1, -1, -0.5], [x1, 2, -0.5]], [[x0, -1, -0.5], [x1, 2, -0.5], [x0, 2, -0.5]]]
    left = [[[x0, 2, -0.5], [x1, 2, -0.5], [x1, 2, 2.0]]]
    right = [[[x0, -1, -0.5], [x1, -1, 2.0], [x1, -1, -0.5]]]
    corners, label = np.array(floor + left + right), np.array([0, 0, 1, 1])
    triangles, known, of = facets_by_known(corners, label, np.zeros(4, int), legs)
    sides = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(sides, axis=1) / 2
    assert area.sum() == pytest.approx(30 + 12.5 + 12.5)
    late = triangles[:, :, 0].mean(axis=1) > 5
    assert ((triangles[:, :, 0] >= 5 - 1e-9).all(axis=1) | (triangles[:, :, 0] <= 5 + 1e-9).all(axis=1)).all()
    assert ((known == GUESS) == (late & (of == 2)))[area > 0].all()
