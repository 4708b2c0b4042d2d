import cv2
import numpy as np
import pytest

from minesurveys.pictures.image import read_image
from pipeline.errors import InputError
from pipeline.survey.drawing.scale import find_bar, measure_bar


def bar(width=200, height=10, shape=(40, 240), at=(15, 20)):
    picture = np.full((*shape, 3), 255, dtype=np.uint8)
    picture[at[0] : at[0] + height, at[1] : at[1] + width] = 0
    return picture


@pytest.mark.parametrize("width", [25, 137, 200])
def test_a_bar_is_measured_to_the_pixel(width):
    assert measure_bar(bar(width), 50.0, "bar") == width / 50.0


def test_the_published_bar_is_782_pixels_for_100_metres(shared_mine):
    assert measure_bar(read_image(shared_mine / "scale_bar.jpg", 10), 100.0, "bar") == pytest.approx(7.82)


@pytest.mark.parametrize(
    ("picture", "message"),
    [
        (np.full((20, 100, 3), 255, np.uint8), "no scale bar"),
        (np.zeros((20, 100, 3), np.uint8), "no scale bar"),
        (np.zeros((0, 5, 3), np.uint8), "box is empty"),
        (bar(8, 120, (160, 40), (10, 10)), "8 px wide and 120 px high; it must lie horizontally"),
        (bar(9, 3), "9 px long, at least 20"),
    ],
    ids=["white", "black", "empty", "vertical", "short"],
)
def test_a_bar_that_cannot_be_measured_is_refused_with_its_size(picture, message):
    with pytest.raises(InputError, match=message):
        measure_bar(picture, 100.0, "plan.png")


def test_a_bar_that_touches_the_edge_of_its_box_is_refused():
    with pytest.raises(InputError, match="touches the edge"):
        measure_bar(bar(200)[:, :150], 100.0, "plan.png")
    with pytest.raises(InputError, match="touches the edge"):
        measure_bar(255 - bar(200), 100.0, "plan.png")  # white on black: the dark region is the paper


def test_a_slanted_bar_and_noise_are_refused():
    slanted = np.full((120, 240, 3), 255, np.uint8)
    for col in range(20, 220):
        slanted[20 + col // 3 : 28 + col // 3, col] = 0
    with pytest.raises(InputError, match="not a straight bar"):
        measure_bar(slanted, 100.0, "plan.png")
    noise = np.random.default_rng(0).integers(0, 256, (60, 300, 3)).astype(np.uint8)
    with pytest.raises(InputError, match=r"plan\.png"):
        measure_bar(noise, 100.0, "plan.png")


def test_a_bar_with_a_separate_tip_is_refused():
    picture = bar(200)
    picture[:, 212:214] = 255
    with pytest.raises(InputError, match=r"broken into 2 pieces \(longest 192 px\)"):
        measure_bar(picture, 100.0, "plan.png")


def test_a_broken_bar_is_refused():
    picture = bar(200)
    picture[:, 100:110] = 255
    with pytest.raises(InputError, match=r"broken into 2 pieces \(longest 110 px\)"):
        measure_bar(picture, 100.0, "plan.png")


def in_pieces(lengths, outlined=False, height=10, at=(30, 80)):
    """Return a bar whose pieces, px, are dark and light in turn, and its length."""
    total = sum(lengths)
    picture = np.full((90, total + 160, 3), 255, np.uint8)
    row, col = at
    if outlined:
        cv2.rectangle(picture, (col, row), (col + total - 1, row + height - 1), (0, 0, 0), 1)
    for k, length in enumerate(lengths):
        if k % 2 == 0:
            picture[row : row + height, col : col + length] = 0
        col += length
    return picture, total


def with_digits(picture, total):
    for text, col in (("0m", 36), ("10m", 80 + total + 6)):
        cv2.putText(picture, text, (col, 42), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (0, 0, 0), 1, cv2.LINE_AA)
    return picture


@pytest.mark.parametrize(
    ("lengths", "outlined"),
    [([200], False), ([40, 40, 40, 40, 40], False), ([40, 40, 80], False), ([25, 25, 25, 25, 25, 25], True)],
    ids=["plain", "alternating", "of two lengths", "outlined"],
)
@pytest.mark.parametrize("digits", [False, True])
def test_a_bar_with_digits_at_its_ends_is_found_and_measured_whole(lengths, outlined, digits):
    picture, total = in_pieces(lengths, outlined)
    picture = with_digits(picture, total) if digits else picture
    picture[60:85, 20:200] = 40  # the workings
    box = find_bar(picture)
    assert box is not None
    left, top, right, bottom = box
    assert measure_bar(picture[top:bottom, left:right], 1.0, "bar") == pytest.approx(total, abs=1)


def test_a_bar_in_two_rows_is_found_and_measured_whole():
    picture = np.full((90, 360, 3), 255, np.uint8)
    for k in range(5):
        picture[(30, 36)[k % 2] : (36, 42)[k % 2], 80 + 40 * k : 120 + 40 * k] = 0
    picture[60:85, 20:300] = 40
    left, top, right, bottom = find_bar(with_digits(picture, 200))
    assert measure_bar(picture[top:bottom, left:right], 1.0, "bar") == pytest.approx(200, abs=1)


@pytest.mark.parametrize(("long_px", "apart_px", "high_px"), [(16, 16, 3), (16, 22, 6), (16, 16, 6)])
def test_dashes_of_a_line_and_blocks_with_other_gaps_are_no_bar(long_px, apart_px, high_px):
    picture = np.full((90, 700, 3), 255, np.uint8)
    for k in range(15):
        left = 20 + (long_px + apart_px) * k
        picture[30 : 30 + high_px, left : left + long_px] = 0
    picture[60:85, 20:300] = 40
    assert find_bar(picture) is None


def test_a_line_with_ticks_at_its_ends_is_measured_between_their_middles():
    picture = np.full((60, 340, 3), 255, np.uint8)
    picture[30:32, 60:262] = picture[22:40, 60:62] = picture[22:40, 260:262] = 0
    for text, col in (("0", 54), ("10m", 250)):
        cv2.putText(picture, text, (col, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    assert measure_bar(picture, 10.0, "bar") == 20.0
    picture[22:40, 260:262] = 255  # with one tick it is none
    with pytest.raises(InputError, match="not a straight bar"):
        measure_bar(picture, 10.0, "bar")
