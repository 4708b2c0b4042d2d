"""The workings on drawings of generated mines."""

import cv2
import numpy as np
import pytest

from benchmarks.pictures.paper_drawing import draw_on_paper
from pipeline.errors import GeometryError
from pipeline.geometry.drawing.candidates import choose_plan
from pipeline.geometry.drawing.find import read_drawing
from pipeline.geometry.drawing.wall_lines import DrawnWalls
from pipeline.metrics.iou import intersection_over_union as iou
from pipeline.params.stated import StatedOptions
from pipeline.survey.detect import detect_survey
from pipeline.survey.drawing.scale import find_bar, measure_bar


@pytest.mark.parametrize(
    ("seed", "walls"),
    [
        (2, "filled"),
        pytest.param(6, "filled", marks=pytest.mark.slow),
        (10, "hatched"),
        (13, "lines"),
        pytest.param(56, "lines", marks=pytest.mark.slow),
        pytest.param(1026, "filled", marks=pytest.mark.slow),
        pytest.param(1037, "lines", marks=pytest.mark.slow),
    ],
)
def test_workings_are_found_among_everything_else_on_a_drawing(seed, walls):
    drawing = draw_on_paper(seed)
    found = read_drawing(drawing.picture, None)
    assert found.walls == walls
    assert iou(found.mask, drawing.levels[0]) > 0.95


def test_a_drawing_of_several_levels_is_asked_about_and_the_option_settles_it():
    drawing = draw_on_paper(40)
    with pytest.raises(GeometryError, match=r"the drawing shows 3 plans .*--level N chooses one"):
        read_drawing(drawing.picture, None)
    assert iou(read_drawing(drawing.picture, 3).mask, drawing.levels[2]) > 0.95


def test_of_many_plans_the_first_are_listed_so_that_the_message_has_room_for_the_option():
    areas = np.zeros((400, 400), bool)
    for k in range(25):
        row, col = 10 + 75 * (k // 5), 10 + 75 * (k % 5)
        areas[row : row + 20, col : col + 50] = True
    with pytest.raises(GeometryError, match=r"25 plans \(1: .*; 8: [^;]*; \.\.\.\); --level N chooses one") as refused:
        choose_plan(areas, list(range(1, 26)), None)
    assert len(str(refused.value)) < 500
    assert choose_plan(areas, list(range(1, 26)), 25)[0].sum() == 1000
    with pytest.raises(GeometryError, match="--level 26: the drawing shows 25 plans"):
        choose_plan(areas, list(range(1, 26)), 26)


def test_a_drawing_without_workings_is_refused():
    with pytest.raises(GeometryError, match="--crop"):
        read_drawing(np.full((300, 400, 3), 255, np.uint8), None)


def test_walls_enclose_up_to_the_middle_of_their_lines_across_gaps():
    lines = np.zeros((120, 200), bool)
    lines[30:33, 20:180] = lines[80:83, 20:180] = lines[30:83, 20:23] = lines[30:83, 177:180] = True
    lines[30:33, 90:99] = False
    drawn_walls = DrawnWalls(lines)
    inside = drawn_walls.areas(6.0)
    truth = np.zeros_like(lines)
    truth[31:82, 21:179] = True
    assert iou(inside, truth) > 0.96
    assert not drawn_walls.areas(3.0).any()


def test_a_scale_bar_in_alternating_pieces_is_found_and_measured():
    picture = np.full((80, 300, 3), 255, np.uint8)
    picture[40:47, 40:241] = 0
    picture[41:46, 91:140] = picture[41:46, 191:240] = 255
    picture[6:34, 6:80] = 60
    box = find_bar(picture)
    assert box is not None
    assert measure_bar(picture[box[1] : box[3], box[0] : box[2]], 20.0, "bar") == pytest.approx(10.05, abs=0.05)


def test_new_reads_a_drawing_as_one_and_shows_what_it_took(tmp_path):
    drawing = draw_on_paper(10)
    path = tmp_path / "drawing.png"
    cv2.imwrite(str(path), drawing.picture)
    found = detect_survey(path, StatedOptions(px_per_m=drawing.px_per_m))
    assert found.values["workings_only"]
    assert found.picture is not None
    assert found.picture.shape == drawing.picture.shape
