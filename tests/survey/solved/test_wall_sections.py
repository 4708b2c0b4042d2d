"""Sections where splays hit: chambers whose walls are known, measured by rays that are cast here."""

from pathlib import Path

import numpy as np
import pytest
import shapely

from minesurveys.frames import Source
from minesurveys.solved.model import LegFlag, Passage, SolvedSurvey
from pipeline.survey.solved.plan_view import plan_legs
from pipeline.volume.height_field.assumed_roofs import network_with_roofs
from pipeline.volume.union import pieces_of, unite

UP, DOWN = 1.5, 1.2
# A drift with an alcove, and a wider end.
DRIFT = shapely.Polygon([(0, -1), (20, -1), (20, -3), (30, -3), (30, 3), (20, 3), (20, 1.5), (12, 1.5), (12, 4), (8, 4),
                         (8, 1.5), (0, 1.5)])  # fmt: skip


def seen_from(places, polygon, angles, height=0.0):
    """Return the way (k, 3) m from a place to a polygon's border in directions, deg."""
    found = []
    for angle in np.radians(angles):
        ray = shapely.LineString([places[:2], np.array(places[:2]) + 100 * np.array([np.cos(angle), np.sin(angle)])])
        hit = shapely.get_coordinates(ray.intersection(polygon.exterior))
        away = hit - np.array(places[:2])
        found.append([*away[np.linalg.norm(away, axis=1).argmin()], height])
    return np.array(found)


def survey_of(places, legs, splays, passages=()):
    """Return a survey of stations (n, 3), legs between them, and splays, steps (k, 3) by station."""
    ends = [(k, np.add(places[k], step)) for k, steps in splays.items() for step in steps]
    everywhere = np.array([*places, *(end for _, end in ends)], float)
    pairs = [*legs, *((k, len(places) + n) for n, (k, _) in enumerate(ends))]
    flags = np.array([0] * len(legs) + [LegFlag.SPLAY] * len(ends), np.uint8)
    names = tuple([*"abcdefgh"[: len(places)], *[""] * len(ends)])
    stations = np.array([0] * len(places) + [0x20] * len(ends), np.uint8)
    return SolvedSurvey(names, everywhere, stations, np.array(pairs), flags, np.zeros(len(pairs), np.uint8), passages)


def built(survey, half_width_m=1.0):
    """Return the legs of a survey, and the triangles (t, 3, 3) m of the volume that they make."""
    legs = plan_legs(Path("cave.3d"), survey, half_width_m)
    network = network_with_roofs(legs, 3.5, 1.0)
    volume = unite(network, pieces_of(network))
    middle = next(leg for leg in legs if "a" in leg.stations)
    start = middle.stations.index("a")
    offset = [*middle.positions_m[start], middle.heights_m[start, 0]] - network.places_m[network.names.index("a")]
    return legs, (volume.vertices + offset)[volume.faces]


def way_to_wall(triangles, start, step):
    """Return how far, m, the nearest triangle (t, 3, 3) is from a place in a direction (Moeller and Trumbore)."""
    start, ahead = np.asarray(start, float), np.asarray(step, float) / np.linalg.norm(step)
    a, one, two = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    across = np.cross(ahead, two)
    det = np.sum(one * across, axis=1)
    inverse = 1 / np.where(np.abs(det) < 1e-12, np.inf, det)
    apart = start - a
    u = np.sum(apart * across, axis=1) * inverse
    turned = np.cross(apart, one)
    v, t = turned @ ahead * inverse, np.sum(two * turned, axis=1) * inverse
    hit = (np.abs(det) > 1e-12) & (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 1e-3)
    return float(t[hit].min())


def test_walls_are_where_level_splays_from_the_stations_hit_them():
    places = [(1.0, 0, 0), (9, 0.5, 0), (19, 0, 0), (26, 0, 0.5)]
    angles = [*range(25, 160, 13), *range(205, 340, 13)]
    splays = {k: seen_from(place, DRIFT, angles) for k, place in enumerate(places)}
    splays[3] = np.concatenate([splays[3], seen_from(places[3], DRIFT, [-20, 0, 20])])
    for k in splays:
        splays[k] = np.concatenate([splays[k], [[0, 0, UP], [0, 0, -DOWN]]])
    _, triangles = built(survey_of(places, [(0, 1), (1, 2), (2, 3)], splays))
    off = []
    for k, place in enumerate(places):
        level = splays[k][:-2]
        off += [way_to_wall(triangles, place, step) - np.linalg.norm(step) for step in level]
    off = np.array(off)
    assert (np.abs(off) <= 0.1).mean() >= 0.8
    assert (off < -0.3).mean() <= 0.05


def test_a_splay_through_a_window_into_another_passage_does_not_widen_its_own():
    places = [(0.0, 0, 0), (20, 0, 0), (0, 9, 5), (20, 9, 5)]  # two drifts that no leg joins
    aside = [[0, 1.5, 0], [0, -1.5, 0]]
    through = [[1.0, 8.5, 4.6]]
    ends = {0: aside, 1: aside, 2: aside, 3: aside}
    narrow = plan_legs(Path("cave.3d"), survey_of(places, [(0, 1), (2, 3)], ends), 1.0)
    survey = survey_of(places, [(0, 1), (2, 3)], ends | {0: aside + through})
    legs = plan_legs(Path("cave.3d"), survey, 1.0)
    assert [leg.walls_m.tolist() for leg in legs] == [leg.walls_m.tolist() for leg in narrow]


def test_what_is_measured_holds_on_its_side_and_the_rest_is_assumed():
    places = [(0.0, 0, 0), (40, 0, 0), (80, 0, 3)]
    (leg,) = plan_legs(Path("cave.3d"), survey_of(places, [(0, 1), (1, 2)], {1: [[0.1, 6.0, 0.2]]}), 0.8)
    left = leg.walls_m[:, 0] if leg.stations[0] == "a" else leg.walls_m[:, 1]
    along = leg.positions_m[:, 0]
    assert left[along == 40] == pytest.approx(6.0, abs=1e-3)
    np.testing.assert_allclose(left[np.abs(along - 40) > 15], 0.8)  # it does not go on through the whole passage
    right = leg.walls_m[:, 1] if leg.stations[0] == "a" else leg.walls_m[:, 0]
    np.testing.assert_allclose(right, 0.8)
    at = leg.stations.index("b")
    side = 0 if leg.stations[0] == "a" else 1
    assert leg.known[at, side] == Source.MEASURED
    assert leg.known[at, 1 - side] == Source.ASSUMED


def test_the_remark_on_assumed_walls_says_of_how_many_stations_and_splays_they_come(capsys):
    splays = {1: [[0, 3.0, 0], [0, -2.0, 0]]}
    survey = survey_of([(0.0, 0, 0), (10, 0, 0), (20, 0, 0)], [(0, 1), (1, 2)], splays)
    built(survey, None)
    assert "2.50 m is taken on each side without one, half the median width of the 1 with both, in a survey of 2 " in (
        capsys.readouterr().err
    )


def test_a_passage_goes_on_to_the_face_that_splays_hit_ahead_of_its_end():
    places = [(0.0, 0, 0), (10, 0, 2)]
    ahead = {1: [[4.0, 0.2, 0.3], [3, 1.5, 0], [3.5, -1, 0], [0, 0, -1]]}
    legs, triangles = built(survey_of(places, [(0, 1)], ahead))
    assert way_to_wall(triangles, places[1], ahead[1][0]) == pytest.approx(np.linalg.norm(ahead[1][0]), abs=0.1)
    (leg,) = legs
    assert set("ab") <= set(leg.stations)
    assert leg.surveyed.sum() == 2


def test_an_assumed_roof_is_over_what_splays_passed_and_a_measured_one_stays():
    places = [(0.0, 0, 0), (20, 0, 2)]
    steep = {0: [[3.0, 3, 3.2]], 1: [[0, 0, 1.0], [0, 0, -0.5]]}
    _, triangles = built(survey_of(places, [(0, 1)], steep), 1.0)
    assert way_to_wall(triangles, places[0], steep[0][0]) >= np.linalg.norm(steep[0][0]) - 0.1
    assert way_to_wall(triangles, places[1] + np.array([-0.1, 0, 0]), [0, 0, 1]) == pytest.approx(1.0, abs=0.1)


def test_an_assumed_floor_is_under_what_splays_reached_and_no_steeper_than_45_deg():
    level = [[0, 1.0, 0], [0, -1.0, 0]]
    deep = {0: [*level, [0, 0, -1.0], [4.0, 0.9, -2.0], [9.5, 0.9, -2.0]], 1: [*level, [0, 0, -1.0]]}
    legs, triangles = built(survey_of([(0.0, 0, 0), (10, 0, 0)], [(0, 1)], deep))
    floor = dict(zip(legs[0].stations, legs[0].heights_m[:, 2], strict=True))
    assert floor["a"] == floor["b"] == pytest.approx(1.0)
    (leg,), start = legs, legs[0].positions_m[legs[0].stations.index("a")]
    at = np.linalg.norm(leg.positions_m - start, axis=1)
    assert np.interp(4.0, at, leg.heights_m[:, 2]) == pytest.approx(2.0, abs=0.01)
    assert np.interp(9.5, at, leg.heights_m[:, 2]) == pytest.approx(1.5, abs=0.1)
    assert way_to_wall(triangles, [4.0, 0, 0], [0, 0, -1]) == pytest.approx(2.0, abs=0.02)


def test_sections_of_a_table_are_built_as_they_are():
    places = [(0.0, 0, 0), (10, 0, 1), (20, 5, 2)]
    lrud = np.array([[1.0, 2, 2, 1], [1.5, 1, 2, 1], [1, 1, 3, 0.5]])
    survey = survey_of(places, [(0, 1), (1, 2)], {}, (Passage(np.arange(3), lrud),))
    (leg,) = plan_legs(Path("cave.3d"), survey)
    assert leg.stations == ["a", "b", "c"]
    assert leg.surveyed.all()
    np.testing.assert_array_equal(leg.walls_m, lrud[:, :2])
    assert (leg.known == Source.MEASURED).all()
