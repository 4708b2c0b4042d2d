"""Lines on drawings that are no walls: measures, tables, grids."""

import cv2
import numpy as np
import pytest

from benchmarks.pictures.paper_drawing import draw_on_paper
from pipeline.errors import GeometryError
from pipeline.geometry.drawing.doubts import BesideError, DrawingError, LevelsError, more_helpful, require_on_walls
from pipeline.geometry.drawing.find import read_drawing
from pipeline.geometry.drawing.measures import drop_measures
from pipeline.geometry.drawing.tables import drop_tables
from pipeline.geometry.drawing.wall_lines import drop_ruled
from pipeline.metrics.iou import intersection_over_union as iou


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(4059, id="measures cross drifts with gaps in their walls"),
        pytest.param(4155, id="a measure parts a room", marks=pytest.mark.slow),
        pytest.param(4192, id="measures and survey lines", marks=pytest.mark.slow),
        pytest.param(4095, id="a grid line that compression breaks"),
        pytest.param(4033, id="strokes in the rock, a grid and measures", marks=pytest.mark.slow),
        pytest.param(4039, id="a title block as large as the workings", marks=pytest.mark.slow),
        pytest.param(4093, id="survey lines in narrow drifts", marks=pytest.mark.slow),
        pytest.param(6035, id="grey strokes touch the walls", marks=pytest.mark.slow),
        pytest.param(5152, id="a pillar with wavering walls is no table", marks=pytest.mark.slow),
        pytest.param(5075, id="a frame of two lines is no drawing", marks=pytest.mark.slow),
    ],
)
def test_walls_are_found_beside_lines_that_are_none(seed):
    drawing = draw_on_paper(seed)
    picture = 255 - drawing.picture if "light on dark" in drawing.furniture else drawing.picture
    found = read_drawing(picture, None)
    assert found.walls == "lines"
    assert iou(found.mask, drawing.levels[0]) > 0.95


@pytest.mark.parametrize(
    ("seed", "doubt"),
    [
        pytest.param(6138, "another drawing of", id="another level has gaps in its walls", marks=pytest.mark.slow),
    ],
)
def test_what_lines_do_not_settle_is_asked_about(seed, doubt):
    with pytest.raises(GeometryError, match=doubt):
        read_drawing(draw_on_paper(seed).picture, None)


def test_a_large_title_beside_clean_workings_is_named_and_a_crop_leaves_it_out():
    workings = np.zeros((630, 980), np.uint8)
    drifts = [
        (105, 420, 490, 420),
        (483, 420, 532, 294),
        (525, 294, 875, 294),
        (280, 420, 280, 532),
        (700, 294, 721, 434),
    ]
    for col0, row0, col1, row1 in drifts:
        cv2.line(workings, (col0, row0), (col1, row1), 1, 30)
    contours, _ = cv2.findContours(workings, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    picture = cv2.drawContours(np.full((*workings.shape, 3), 255, np.uint8), contours, -1, (0, 0, 0), 2)
    cv2.putText(picture, "GROTTE", (30, 110), cv2.FONT_HERSHEY_DUPLEX, 2.1, (0, 0, 0), 10, cv2.LINE_AA)
    with pytest.raises(
        GeometryError, match=r"\d+ x 67 px, or a title, lies beside the workings, at \(26, 55\); --crop"
    ):
        read_drawing(picture, None)
    assert iou(read_drawing(picture[150:], None).mask, workings[150:] > 0) > 0.95


def test_of_several_doubts_the_one_that_a_crop_settles_is_shown_unless_levels_are_asked_about():
    found = np.zeros((2, 2), bool)
    nothing, border = GeometryError("nothing"), DrawingError("border", found)
    levels, beside = LevelsError("levels", found), BesideError("beside", found)
    assert [more_helpful(None, nothing), more_helpful(nothing, border), more_helpful(border, nothing)] == [
        nothing,
        border,
        border,
    ]
    assert more_helpful(border, beside) is beside
    assert more_helpful(beside, border) is beside
    assert more_helpful(levels, beside) is levels


def test_a_border_that_leaves_its_walls_is_asked_about():
    workings = np.zeros((300, 400), np.uint8)
    cv2.polylines(workings, [np.array([[60, 60], [200, 220], [350, 90]])], False, 1, 30)
    contours, _ = cv2.findContours(workings, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    lines = cv2.drawContours(np.zeros_like(workings), contours, -1, 1, 2) > 0
    require_on_walls(lines, workings > 0, 30.0)
    workings[:, 300:] = np.roll(workings[:, 300:], 6, axis=0)
    with pytest.raises(GeometryError, match=r"\d+ % of the lines at the workings' border .* are left by it"):
        require_on_walls(lines, workings > 0, 30.0)


def measure(lines, row, first, last, upright=False):
    """A measure as drawing programs draw it: an open arrow at either end."""
    drawn = np.zeros(lines.shape[::-1] if upright else lines.shape, np.uint8)
    cv2.line(drawn, (first, row), (last, row), 1, 1)
    for tip, side in ((first, 1), (last, -1)):
        for up in (-3, 3):
            cv2.line(drawn, (tip, row), (tip + 6 * side, row + up), 1, 1)
    return lines | ((drawn.T if upright else drawn) > 0)


@pytest.mark.parametrize("upright", [False, True])
def test_a_measure_is_removed_and_the_wall_that_it_crosses_stays(upright):
    wall = np.zeros((120, 160), bool)
    wall[10:150, 70:73] = True
    wall = wall.T[:120, :120] if upright else wall
    lines = measure(wall, 60, 30, 110, upright)
    left = drop_measures(lines)
    assert lines.sum() - left.sum() > 60
    assert left[wall].all()


def test_a_wall_between_two_walls_is_no_measure():
    lines = np.zeros((120, 160), bool)
    lines[20:100, 30:33] = lines[20:100, 110:113] = lines[60:62, 30:113] = True
    assert (drop_measures(lines) == lines).all()


def table(words):
    lines = np.zeros((200, 320), np.uint8)
    cv2.rectangle(lines, (20, 20), (180, 140), 1, 1)
    for k, word in enumerate(words):
        cv2.putText(lines, word, (30, 50 + 26 * k), cv2.FONT_HERSHEY_SIMPLEX, 0.35, 1, 1)
    return lines > 0


def test_a_title_block_is_removed_and_what_is_beside_it_stays():
    lines = table(["LEVEL 240", "Scale 1:500", "Sheet 3"])
    lines[170:172, 10:300] = True
    left = drop_tables(np.pad(lines, 60))
    assert left.sum() == 2 * 290


@pytest.mark.parametrize("words", [[], ["P 12"]])
def test_a_rectangular_pillar_is_no_table(words):
    lines = np.pad(table(words), 60)
    for k in range(12):  # hatching of the rock in it
        col, row = 100 + 17 * (k % 6), 155 + 20 * (k // 6)
        lines[range(row, row - 7, -1), range(col, col + 7)] = True
    assert (drop_tables(lines) == lines).all()


def test_a_wall_that_a_grid_line_crosses_is_not_cut():
    lines = np.zeros((200, 300), bool)
    lines[40:140, 100:103] = True
    wall = lines.copy()
    lines[90:92] = True
    left = drop_ruled(lines)
    assert left[wall].all()
    assert left.sum() < wall.sum() + 30
