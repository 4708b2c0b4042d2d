import pytest
import shapely

from pipeline.geometry.rasterize import fill_polygon
from pipeline.geometry.wall_distance import largest_error_m
from pipeline.metrics.wall_error import measure_wall_error, signed_distances
from tests.mines import STRAIGHT, frame_for

FRAME = frame_for(STRAIGHT)
RAW = fill_polygon(STRAIGHT, FRAME)


def test_a_wall_moved_by_ten_centimetres_has_that_error_at_every_point():
    built = STRAIGHT.buffer(-0.1, join_style="mitre")
    found = measure_wall_error(STRAIGHT, built, RAW, FRAME)
    assert (found.mean_m, found.lost_m, found.gained_m) == pytest.approx((0.1, 0.1, 0.0), abs=1e-3)
    assert found.p99_m == pytest.approx(0.1, abs=1e-3)
    assert found.drawn_mean_m == 0.0
    assert found.wall_m == pytest.approx(built.length)


def test_the_error_is_negative_where_the_built_wall_gives_workings():
    built = shapely.box(0, 0, 100, 5.2)
    signed = signed_distances(STRAIGHT, built)
    assert signed.min() == pytest.approx(-0.2)
    assert signed.max() <= 0


def test_the_error_of_a_wall_does_not_depend_on_the_width_of_the_drift():
    narrow, wide = (
        measure_wall_error(m, m.buffer(-0.04, join_style="mitre"), fill_polygon(m, FRAME), FRAME)
        for m in (shapely.box(0, 0, 60, 2.5), shapely.box(0, 0, 60, 5))
    )
    assert narrow.mean_m == pytest.approx(wide.mean_m, rel=1e-3)


def test_a_built_niche_counts_in_the_largest_error_although_no_traced_point_is_far():
    built = STRAIGHT.union(shapely.box(50, 5, 50.02, 7))
    assert largest_error_m(STRAIGHT, built) == pytest.approx(2.0)


def test_a_drawn_piece_that_cleaning_removed_counts_per_metre_of_wall():
    raw = RAW | fill_polygon(shapely.box(20, 5, 22, 6), FRAME)
    found = measure_wall_error(STRAIGHT, STRAIGHT, raw, FRAME)
    assert found.drawn_mean_m == pytest.approx(2.0 / STRAIGHT.length, rel=1e-3)
