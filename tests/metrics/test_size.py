"""The size of a world beside the area of its rock: what every world has is taken off first."""

import pytest
import shapely

from pipeline.metrics.size import FIXED_BYTES, FIXED_PARTS, load_per_m2, measure_size, parts_per_wall_m

DRIFT = shapely.box(0, 0, 100, 5)


def test_the_rock_of_a_drift_is_its_walls_and_its_roof():
    assert measure_size(DRIFT, 3.5, FIXED_BYTES).rock_m2 == pytest.approx(2 * 105 * 3.5 + 500)


def test_bytes_that_every_world_has_do_not_count_and_a_wide_room_has_more_rock_than_a_drift_as_long():
    assert measure_size(DRIFT, 3.5, FIXED_BYTES - 1).bytes == 0
    of_room = measure_size(shapely.box(0, 0, 100, 50), 3.5, FIXED_BYTES + 6_050_000)
    assert of_room.rock_m2 == 6050
    assert of_room.bytes == 1000


def test_the_cost_of_loading_counts_by_area_and_parts_by_metres_of_wall():
    assert load_per_m2(0.25, 115, 2000) == {"load_s": 0.0001, "load_memory_mb": 0.05}
    assert load_per_m2(0.01, 10, 2000)["load_s"] == 0
    assert parts_per_wall_m(FIXED_PARTS + 4 + 21, DRIFT) == 0.1
    assert parts_per_wall_m(4, DRIFT) == 0


def test_a_pillar_has_one_part_that_no_builder_can_do_without_however_thin_it_is():
    columns = [shapely.Point(k, 2.5).buffer(0.15) for k in range(5, 95, 2)]
    hall = shapely.difference(DRIFT, shapely.union_all(columns))
    assert parts_per_wall_m(FIXED_PARTS + len(columns), hall) == 0
    assert parts_per_wall_m(FIXED_PARTS + 2 * len(columns) + 4, hall) == round(len(columns) / hall.length, 4)


def test_a_corner_of_a_room_has_one_part_and_a_bend_of_a_drift_none():
    rooms = shapely.union_all([shapely.box(0, 0, 4, 5), shapely.box(4, 2, 8, 3), shapely.box(8, 0, 12, 5)])
    assert parts_per_wall_m(FIXED_PARTS + 8 + 2, rooms) == round(2 / rooms.length, 4)
    bends = shapely.LineString([(0, 0), (20, 0), (40, 14), (60, 14)]).buffer(2, quad_segs=1, cap_style="flat")
    assert parts_per_wall_m(FIXED_PARTS + 4 + 2, bends) == round(2 / bends.length, 4)
