"""What was seen from stations is free, over the floors, and no other passage's rock."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.survey.solved.plan_view import plan_legs
from pipeline.survey.whole_survey import splays_from
from pipeline.volume.floors import solve_floors
from pipeline.volume.height_field.assumed_roofs import network_with_roofs
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.passages.views import SILL_M, star
from tests.survey.solved.test_wall_sections import survey_of, way_to_wall

UP, DOWN = [0, 0, 1.5], [0, 0, -1.0]
PLACES = [(0.0, 0, 0), (8, 0, 0), (16, 0, 0.2)]
LEVEL = [[0, 1.0, 0], [0, -1.0, 0], UP, DOWN]


def network_of_splays(splays: dict, places: list = PLACES, legs: tuple = ((0, 1), (1, 2))) -> SurveyNetwork:
    """Return the network of a drift of three stations with splays by station, and of further legs."""
    survey = survey_of(places, list(legs), splays)
    made = plan_legs(Path("cave.3d"), survey, 1.0)
    network = network_with_roofs(made, 3.5, 1.0)
    start = next(leg for leg in made if "a" in leg.stations)
    k = start.stations.index("a")
    moved = network.places_m[network.names.index("a")] - [*start.positions_m[k], start.heights_m[k, 0]]
    return replace(network, splays_m=splays_from(made) + moved)


def seen_m(volume, start, step) -> float:
    """Return how far, m, the rock is from a place in the direction of a step."""
    return way_to_wall(volume.vertices[volume.faces], start, step)


def test_a_splay_is_free_where_a_nearer_one_beside_it_hits_a_rib():
    near, far = [1.2, 1.0, 0.0], [1.3, 3.0, 0.9]  # at nearly one place along the drift, at two heights
    network = network_of_splays({0: LEVEL, 1: [*LEVEL, near, far], 2: LEVEL})
    station = network.places_m[network.names.index("b")]
    volume = solve_floors(network)
    assert seen_m(volume, station, far) == pytest.approx(np.linalg.norm(far), abs=0.1)
    without = solve_floors(replace(network, splays_m=np.zeros((0, 2, 3))))
    assert seen_m(without, station, far) < np.linalg.norm(far) - 0.3
    assert volume.inside.distance_m(without.vertices).min() > -0.02  # nothing of it became rock


def test_floors_stay_as_they_are_under_what_was_seen():
    network = network_of_splays({0: LEVEL, 1: [*LEVEL, [1.2, 1.0, 0.0], [1.3, 3.0, 0.6]], 2: LEVEL})
    volume, without = solve_floors(network), solve_floors(replace(network, splays_m=np.zeros((0, 2, 3))))
    middle = network.places_m[network.names.index("b")]
    for aside in (-0.8, 0.0, 0.8):
        place = middle + np.array([1.0, aside, 0.1])
        assert seen_m(volume, place, [0, 0, -1]) == pytest.approx(seen_m(without, place, [0, 0, -1]), abs=0.003)
    beyond = middle + np.array([1.15, 2.2, 0.4])
    assert beyond[2] - seen_m(volume, beyond, [0, 0, -1]) >= middle[2] - 1.0 + SILL_M - 0.02


def test_a_splay_that_ends_deeper_than_the_floor_beyond_its_walls_is_free():
    deep = [1.3, 4.0, -2.0]
    network = network_of_splays({0: LEVEL, 1: [*LEVEL, [1.2, 1.0, 0.0], deep], 2: LEVEL})
    station = network.places_m[network.names.index("b")]
    assert seen_m(solve_floors(network), station, deep) == pytest.approx(np.linalg.norm(deep), abs=0.1)
    without = solve_floors(replace(network, splays_m=np.zeros((0, 2, 3))))
    assert seen_m(without, station, deep) < np.linalg.norm(deep) - 0.3


def test_no_view_goes_through_a_window_into_another_passage():
    places = [*PLACES, (0.0, 9, 5), (16, 9, 5)]
    aside = {0: LEVEL, 1: [*LEVEL, [0.5, 8.5, 4.6]], 2: LEVEL, 3: LEVEL, 4: LEVEL}
    network = network_of_splays(aside, places, ((0, 1), (1, 2), (3, 4)))
    volume = solve_floors(network)
    station = network.places_m[network.names.index("b")]
    assert seen_m(volume, station, [0.5, 8.5, 4.6]) < 3.0


def test_a_view_goes_through_the_ends_of_splays_and_is_small_elsewhere():
    steps = np.array([[3.0, 0, 0], [2.9, 0.9, 0.2], [0, 0, 1.0]])
    corners, faces = star(steps, np.array([True, True, False]))
    for step in steps[:2]:
        assert np.linalg.norm(corners - step, axis=1).min() < 1e-9
    behind = corners[corners[:, 0] < -1e-6]
    assert np.linalg.norm(behind, axis=1).max() <= 0.06
    volume = np.einsum("fd,fd->f", corners[faces[:, 0]], np.cross(corners[faces[:, 1]], corners[faces[:, 2]]))
    assert (volume >= -1e-12).all()  # every facet is seen from the station
