"""Hatched and filled workings on drawings: what bounds them, and what does not."""

from contextlib import suppress

import cv2
import numpy as np
import pytest

from benchmarks.pictures.paper_drawing import draw_on_paper
from pipeline.errors import GeometryError
from pipeline.geometry.drawing.doubts import require_filled
from pipeline.geometry.drawing.fills import find_filled, find_ink
from pipeline.geometry.drawing.find import read_drawing
from pipeline.geometry.drawing.hatches import find_hatched
from pipeline.metrics.iou import intersection_over_union as iou


def shown(seed):
    drawing = draw_on_paper(seed)
    return (255 - drawing.picture if "light on dark" in drawing.furniture else drawing.picture), drawing.levels[0]


def cross(wide):
    """A level and an upright drift with exactly straight walls."""
    workings = np.zeros((420, 620), bool)
    workings[200 : 200 + wide, 40:580] = workings[60:380, 300 : 300 + wide] = True
    return workings


def hatched(workings, outline_px, step=6):
    picture = np.full((*workings.shape, 3), 255, np.uint8)
    rows, cols = np.indices(workings.shape)
    picture[workings & ((rows + cols) % step < 1)] = 60
    if outline_px:
        contours, _ = cv2.findContours(workings.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(picture, contours, -1, (0, 0, 0), outline_px)
    return picture


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(4130, id="strokes in the rock touch the outline"),
        pytest.param(4009, marks=pytest.mark.slow, id="strokes, a thick outline, survey lines and measures"),
        pytest.param(50, marks=pytest.mark.slow, id="grid lines run beside the walls"),
        pytest.param(4028, marks=pytest.mark.slow, id="grid lines cross walls that are nearly straight"),
        pytest.param(4091, id="dense hatching with light letters"),
        pytest.param(5050, marks=pytest.mark.slow, id="an outline as thick as a filling, and a frame of two lines"),
        pytest.param(4068, marks=pytest.mark.slow, id="a short crosscut, strokes and compression"),
    ],
)
def test_hatched_workings_end_at_the_middle_of_their_outline(seed):
    picture, truth = shown(seed)
    found = read_drawing(picture, None)
    assert found.walls == "hatched"
    assert iou(found.mask, truth) > 0.98


@pytest.mark.parametrize("outline_px", [1, 3])
def test_straight_walls_of_a_hatched_area_are_no_grid(outline_px):
    workings = cross(40)
    found = read_drawing(hatched(workings, outline_px), None)
    assert found.walls == "hatched"
    assert iou(found.mask, workings) > 0.96


@pytest.mark.parametrize("wide", [40, 120])
def test_a_hatched_area_without_an_outline_is_asked_about(wide):
    with pytest.raises(GeometryError, match=r"--crop|--seed"):
        read_drawing(hatched(cross(wide), 0), None)


@pytest.mark.parametrize(
    ("wide", "step"),
    [(40, 6), *(pytest.param(*hatching, marks=pytest.mark.slow) for hatching in ((24, 5), (40, 8)))],
)
@pytest.mark.parametrize("broken", [slice(60, 220), slice(120, 150), slice(380, 400)])
def test_a_hatched_area_whose_outline_breaks_off_is_asked_about_or_found_as_a_whole(wide, step, broken):
    picture = hatched(cross(wide), 3, step)
    picture[190:206, broken] = 255  # the outline and the beginning of the hatching
    with suppress(GeometryError):
        assert iou(read_drawing(picture, None).mask, cross(wide)) > 0.95


def test_a_hatched_drift_that_has_one_wall_only_is_asked_about():
    picture = hatched(cross(40), 3)
    picture[190:210, 60:220] = 255
    with pytest.raises(GeometryError, match=r"--crop|--seed"):
        read_drawing(picture, None)


def test_hatching_that_a_light_word_parts_is_not_left_out_silently():
    picture, _ = shown(8050)
    with pytest.raises(GeometryError, match=r"a piece of \d+ px with the same filling lies beside .* at \(106, 287\)"):
        read_drawing(picture, None)


@pytest.mark.slow
def test_two_walls_and_a_survey_line_are_no_hatching():
    picture, _ = shown(4053)
    with pytest.raises(GeometryError) as raised:
        read_drawing(picture, None)
    assert "hatched area" not in str(raised.value)
    assert "same filling" not in str(raised.value)


def test_strokes_in_the_rock_form_no_area():
    picture, _ = shown(4033)
    assert find_hatched(find_ink(picture)).mean() < 0.02


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(4127, id="a light fill, compressed"),
        pytest.param(4187, id="light letters part a drift"),
        pytest.param(1126, marks=pytest.mark.slow, id="dark letters part a drift"),
        pytest.param(4125, marks=pytest.mark.slow, id="thick outlines and survey lines in narrow drifts"),
        pytest.param(4104, marks=pytest.mark.slow, id="slivers of filling between a survey line and a wall"),
        pytest.param(4000, id="a grid line runs beside a wall"),
        pytest.param(7107, marks=pytest.mark.slow, id="two light words in a drift, and one across its end"),
        pytest.param(7041, marks=pytest.mark.slow, id="compression leaves slivers of the filling beside a measure"),
    ],
)
def test_filled_workings_end_at_the_middle_of_their_outline_whatever_is_written_in_them(seed):
    picture, truth = shown(seed)
    found = read_drawing(picture, None)
    assert found.walls == "filled"
    assert iou(found.mask, truth) > 0.97


def test_cells_of_paper_between_outlines_grid_lines_and_strokes_are_rock():
    picture, truth = shown(7024)
    assert iou(read_drawing(picture, None).mask, truth) > 0.96


def filled(workings):
    picture = np.full((*workings.shape, 3), 255, np.uint8)
    picture[workings] = 150
    return picture


def test_a_drift_that_a_white_band_parts_from_the_rest_is_not_left_out_silently():
    picture = filled(cross(40))
    assert iou(read_drawing(picture, None).mask, cross(40)) > 0.99
    picture[300:312] = 255
    with pytest.raises(GeometryError, match=r"a piece of \d+ px with the same filling lies beside .* at \(300, 31\d\)"):
        read_drawing(picture, None)


def test_workings_of_two_fillings_are_not_read_as_one_of_them():
    picture = filled(cross(40))
    picture[:, 320:][cross(40)[:, 320:]] = 90
    with pytest.raises(GeometryError, match=r"--crop|--ignore|--seed"):
        read_drawing(picture, None)


def test_a_short_drift_in_another_shade_is_not_left_out_silently():
    picture = filled(cross(40))
    picture[60:110, 300:340] = 60
    with pytest.raises(GeometryError, match=r"an area of \d+ px with another filling lies beside .* at \(300, \d+\)"):
        read_drawing(picture, None)


def test_small_cells_of_paper_that_matter_are_asked_about():
    workings = cross(40)
    cells = np.zeros_like(workings)
    cells[170:200, 60:280] = True
    require_filled(workings, workings, workings, workings)
    with pytest.raises(GeometryError, match=r"whether small cells of paper belong to them \(IoU 0\.8\d between"):
        require_filled(workings, workings | cells, workings, workings)


def test_workings_far_from_their_filling_are_asked_about():
    workings = cross(40)
    filling = workings.copy()
    filling[200:240, 60:100] = False
    with pytest.raises(GeometryError, match=r"\d\.\d % of the workings lie more than 6 px from their filling"):
        require_filled(filling, workings, workings, workings)


@pytest.mark.parametrize(("letter", "bound"), [(True, "filling"), (False, "lines")])
def test_a_small_cell_of_paper_is_a_letter_if_filling_bounds_it_and_rock_if_lines_do(letter, bound):
    picture = filled(cross(40))
    if letter:
        cv2.putText(picture, "H", (100, 228), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1)
    else:  # a cell between the outline and two strokes
        cv2.rectangle(picture, (100, 182), (116, 198), (0, 0, 0), 2)
    found = find_filled(picture, np.array([150.0] * 3))
    assert found[215:230, 100:112].all()
    assert not found[186:194, 104:112].any()


def test_workings_no_wider_than_lines_are_asked_about():
    workings = cross(7)
    picture = filled(workings)
    contours, _ = cv2.findContours(workings.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, contours, -1, (0, 0, 0), 2)
    with pytest.raises(GeometryError, match=r"--crop|--seed"):
        read_drawing(picture, None)
