import cv2
import numpy as np
import pytest
import shapely

from minesurveys.pictures.image import read_image
from pipeline.errors import GeometryError, InputError
from pipeline.geometry.outline.binarize import binarize, clean_mask, fill_islands, require_workings
from pipeline.geometry.outline.components import choose_mask_component
from pipeline.store.mine_survey import MineSurvey
from pipeline.survey.draw import draw_plan, frame_around
from pipeline.survey.drawing.scale import measure_bar
from pipeline.types import DrawnPlan, Workings
from stages.contours import trace_free_space
from tests.composed import compose
from tests.mines import RING, STRAIGHT, frame_for, plan_of, survey_of


def test_a_drawn_plan_has_the_workings_the_labels_and_a_bar_with_the_right_scale():
    frame = frame_around((-10, -20, 110, 20), 8.0)
    drift = shapely.box(-0.0625, -0.0625, 99.9375, 4.9375)  # pixel borders are at odd sixteenths of a metre
    plan, (col0, row0, col1, row1) = draw_plan(drift, frame, {"A": (50, 13)}, 50.0, 40)
    assert measure_bar(plan[row0:row1, col0:col1], 50.0, "bar") == 8.0
    mask = binarize(plan, None, 40, 2, [(col0, row0, col1, row1)])
    assert mask.sum() == drift.area * 64
    red = (plan[..., 2] > 200) & (plan[..., 1] < 60)
    assert red.sum() > 100


def test_the_mines_origin_is_a_pixels_centre():
    frame = frame_around((-10, -20, 110, 20), 7.82)
    assert frame.origin_col % 1 == 0.5
    assert frame.origin_row % 1 == 0.5
    assert frame.to_mine(frame.to_image(np.array([[12.5, -3.25]]))) == pytest.approx(np.array([[12.5, -3.25]]))


def test_a_plan_without_space_for_its_scale_bar_is_refused():
    with pytest.raises(InputError, match="no corner"):
        draw_plan(STRAIGHT, frame_around((-1, -1, 101, 6), 5.0), {}, 100.0, 40)


def test_red_letters_are_not_workings():
    frame = frame_for(RING)
    plan = plan_of(RING, frame)
    clean_mask = binarize(plan, None, 40, 2, [])
    plan[5:25, 5:25] = (0, 0, 255)
    assert (binarize(plan, None, 40, 2, []) == clean_mask).all()


def test_gaps_are_bridged_specks_are_dropped_and_small_holes_are_filled():
    frame = frame_for(STRAIGHT)
    mask = binarize(plan_of(STRAIGHT, frame), None, 40, 2, [])
    damaged = mask.copy()
    damaged[:, 400:404] = False  # a gap of half a metre
    damaged[2:4, 2:4] = True  # a speck
    damaged[50:54, 200:204] = False  # a hole of a quarter square metre
    repaired = fill_islands(choose_mask_component(clean_mask(damaged, 0.5 * 8, 0.5 * 8), frame, []), 10 * 64)
    assert np.count_nonzero(repaired != mask) <= 48  # the morphological opening rounds the corners


def test_the_larger_of_two_components_is_kept():
    frame = frame_for(shapely.box(0, 0, 100, 30))
    two = shapely.union_all([shapely.box(0, 0, 100, 5), shapely.box(0, 20, 40, 25)])
    kept = choose_mask_component(binarize(plan_of(two, frame), None, 40, 0, []), frame, [])
    assert kept.sum() == 100 * 5 * 64


def test_a_large_island_is_kept_and_a_small_one_is_filled():
    frame = frame_for(STRAIGHT)
    mine = STRAIGHT.difference(shapely.box(20, 1, 24, 4)).difference(shapely.box(60, 1, 62, 4))
    kept = fill_islands(binarize(plan_of(mine, frame), None, 40, 0, []), 10 * 64)
    assert kept.sum() == (500 - 12) * 64


def test_an_inverted_plan_is_refused():
    frame = frame_for(STRAIGHT)
    raw = binarize(255 - plan_of(STRAIGHT, frame), None, 40, 0, [])
    with pytest.raises(GeometryError, match="is the plan inverted"):
        require_workings(raw, choose_mask_component(raw, frame, []), 8.0, 50.0, 0.5)


def test_a_plan_without_a_large_dark_region_is_refused_with_the_largest_area():
    frame = frame_for(shapely.box(0, 0, 20, 20))
    raw = binarize(plan_of(shapely.box(0, 0, 4, 3), frame), None, 40, 0, [])
    with pytest.raises(GeometryError, match=r"larger than 50 m2 \(largest is 12\.0 m2 at 8\.00 px/m\)"):
        require_workings(raw, choose_mask_component(raw, frame, []), 8.0, 50.0, 0.5)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "empty file"),
        (b"not an image at all", "not a picture that can be read"),
        (cv2.imencode(".png", np.zeros((30, 30, 3), np.uint8))[1].tobytes(), "all black"),
        (cv2.imencode(".png", np.full((30, 30, 3), 255, np.uint8))[1].tobytes(), "all white"),
        (
            cv2.imencode(".png", np.eye(2000, dtype=np.uint8) * 255)[1].tobytes(),
            r"4\.0 megapixels, the limit is 1 \(survey\.max_megapixels\); save it at 50 % of its size",
        ),
        (
            cv2.imencode(".png", np.eye(300, dtype=np.uint8) * 255)[1].tobytes()[:200],
            "not a picture|cannot be decoded",
        ),
    ],
    ids=["empty", "text", "black", "white", "huge", "cut"],
)
def test_an_image_that_cannot_be_a_plan_is_refused_with_its_name(tmp_path, data, message):
    path = tmp_path / "plan.png"
    path.write_bytes(data)
    with pytest.raises(InputError, match=message):
        read_image(path, 1.0)


@pytest.mark.parametrize("room", [shapely.box(0, 0, 120, 100), shapely.box(0, 0, 15, 1.6)])
def test_workings_of_a_vector_file_are_no_inverted_plan_however_large_or_small(room):
    frame = frame_for(room)
    outline, contours = Workings(shapely.MultiPolygon([room])), compose([]).contours
    mine = MineSurvey(survey_of(frame, (5.0, 0.8)), plan_of(room, frame), DrawnPlan(), outline)
    traced = trace_free_space(contours, mine)
    assert traced["free_space"].polygon.area == pytest.approx(room.area)
