import cv2
import numpy as np
import pytest

from benchmarks.pictures.paper_drawing import draw_on_paper
from pipeline.geometry.drawing import bounded
from pipeline.geometry.drawing.bounded import read_bounded, share_of
from pipeline.geometry.drawing.doubts import DrawingError
from pipeline.geometry.drawing.fills import find_ink, paper_colour
from pipeline.geometry.drawing.find import read_drawing
from pipeline.metrics.iou import intersection_over_union as iou


def enlarged(seed, factor):
    drawing = draw_on_paper(seed)
    picture = cv2.resize(drawing.picture, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
    truth = cv2.resize(drawing.levels[-1].astype(np.uint8), picture.shape[1::-1], interpolation=cv2.INTER_LINEAR) > 0
    return picture, truth


@pytest.mark.parametrize("seed", [pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 13)])
def test_a_large_drawing_is_searched_at_a_bounded_resolution_and_its_workings_have_its_own_size(monkeypatch, seed):
    picture, truth = enlarged(seed, 2.0)
    small = read_drawing(draw_on_paper(seed).picture, None)
    monkeypatch.setattr(bounded, "MOST_PX", picture.shape[0] * picture.shape[1] / 4)
    assert share_of(picture) == pytest.approx(0.5)
    found = read_bounded(picture, None)
    assert found.mask.shape == picture.shape[:2]
    assert iou(found.mask, truth) > 0.94
    assert found.width_px == pytest.approx(2 * small.width_px, rel=0.1)
    assert np.array(found.boxes) == pytest.approx(2 * np.array(small.boxes), abs=6)


def test_a_doubt_about_a_large_drawing_shows_what_was_found_in_its_own_size(monkeypatch):
    picture, truth = enlarged(40, 2.0)
    monkeypatch.setattr(bounded, "MOST_PX", picture.shape[0] * picture.shape[1] / 4)
    with pytest.raises(DrawingError, match=r"3 plans .*\(the picture was searched at 50 % of its size\)") as doubt:
        read_bounded(picture, None)
    assert doubt.value.found.shape == picture.shape[:2]
    assert iou(read_bounded(picture, 3).mask, truth) > 0.9


@pytest.mark.parametrize("stroke_px", [1, 2, 8])
def test_walls_of_thin_lines_stay_dark_in_the_copy(stroke_px):
    picture = np.full((2000, 3000, 3), 255, np.uint8)
    cv2.rectangle(picture, (301, 301), (2500, 1500), (0, 0, 0), stroke_px)
    copy = bounded._copy_of(picture, 0.3)
    assert copy.shape == (600, 900, 3)
    assert copy[90:451, 400].min() < 90
    assert copy[270, 80:100].min() < 90


def test_a_filled_area_keeps_its_border_in_the_copy():
    picture = np.full((2000, 3000, 3), 255, np.uint8)
    picture[600:900, 300:2400] = 40
    copy = bounded._copy_of(picture, 1 / 3)
    assert (copy[..., 0] < 128).sum() == 100 * 700


@pytest.mark.parametrize("rows", [1, 7, 300, 600])
def test_the_colour_of_the_paper_and_the_ink_are_those_of_the_whole_picture_though_found_in_strips(rows):
    rng = np.random.default_rng(rows)
    picture = np.where(rng.random((rows, 50, 1)) < 0.8, 240 + rng.integers(0, 8, (rows, 50, 3)), 30).astype(np.uint8)
    coarse = (picture >> 3).reshape(-1, 3)
    colours, which, counts = np.unique(coarse, axis=0, return_inverse=True, return_counts=True)
    assert len(colours) == 2
    paper = np.median(picture.reshape(-1, 3)[which.ravel() == counts.argmax()], axis=0)
    assert paper_colour(picture).tolist() == paper.tolist()
    assert (find_ink(picture) == (np.abs(picture - paper.astype(np.int16)).max(axis=2) > 24)).all()
