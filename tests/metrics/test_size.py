"""The size of a world beside the area of its rock: what every world has is taken off first."""

import numpy as np
import pytest
import shapely

from pipeline.compose import compose
from pipeline.geometry.rock.collision import exact_prisms
from pipeline.geometry.rock.partition import rock_around, world_box
from pipeline.metrics.size import FIXED_BYTES, PARTS_PER_CORNER, load_per_m2, measure_size, parts_per_wall_m

DRIFT = shapely.box(0, 0, 100, 5)


def test_the_rock_of_a_drift_is_its_walls_and_its_roof():
    assert measure_size(DRIFT, 3.5, FIXED_BYTES).rock_m2 == pytest.approx(2 * 105 * 3.5 + 500)


def test_bytes_that_every_world_has_do_not_count_and_a_wide_room_has_more_rock_than_a_drift_as_long():
    assert measure_size(DRIFT, 3.5, FIXED_BYTES - 1).bytes == 0
    of_room = measure_size(shapely.box(0, 0, 100, 50), 3.5, FIXED_BYTES + 6_050_000)
    assert of_room.rock_m2 == 6050
    assert of_room.bytes == 1000


def test_the_cost_of_loading_counts_by_area_and_parts_by_metres_of_wall():
    assert load_per_m2(0.25, 160, 2000) == {"load_s": 0.0001, "load_memory_mb": 0.05}
    assert load_per_m2(0.01, 10, 2000)["load_s"] == 0
    assert parts_per_wall_m(4 * PARTS_PER_CORNER + 21, DRIFT) == 0.1
    assert parts_per_wall_m(4, DRIFT) == 0


def test_a_pillar_has_one_part_however_thin_it_is():
    columns = [shapely.Point(k, 2.5).buffer(0.15) for k in range(5, 95, 2)]
    hall = shapely.difference(DRIFT, shapely.union_all(columns))
    allowed = 4 * PARTS_PER_CORNER + len(columns)
    assert parts_per_wall_m(allowed, hall) == 0
    assert parts_per_wall_m(allowed + len(columns), hall) == round(len(columns) / hall.length, 4)


def test_a_corner_round_which_a_wall_turns_allows_two_parts_and_one_where_rock_juts_out_none():
    rooms = shapely.union_all([shapely.box(0, 0, 4, 5), shapely.box(4, 2, 8, 3), shapely.box(8, 0, 12, 5)])
    assert parts_per_wall_m(8 * PARTS_PER_CORNER + 2, rooms) == round(2 / rooms.length, 4)


@pytest.mark.parametrize("corners", [40, 120, 240])
def test_exact_parts_of_ragged_walls_are_within_the_limit_however_small_the_room(corners):
    rng, most = np.random.default_rng(0), compose(["survey=procedural"]).validation.limits["collision.parts_per_wall_m"]
    angles, radii = np.sort(rng.uniform(0, 2 * np.pi, corners)), rng.uniform(5, 7, corners)
    ragged = shapely.Polygon(np.c_[radii * np.cos(angles), radii * np.sin(angles)])
    parts = len(exact_prisms(rock_around(ragged, world_box(ragged, 2.0, ragged.bounds)), 3.0))
    assert parts / ragged.length > 0.29  # parts a metre of straight drifts
    assert parts_per_wall_m(parts, ragged) == 0
    assert parts_per_wall_m(2 * parts, ragged) > most.max
