"""Large pictures are read at a part of their size; what the user states in px is of the whole picture."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import PlanSurveyParams
from pipeline.survey.detect import detect_here
from pipeline.survey.drawing import reduction
from pipeline.survey.drawing.reduction import FITTING_PX, fitting_reduction, in_reduced_px, reduce_picture
from pipeline.survey.load import read_here
from tests.mines import TEE, frame_for, plan_of

BAR = (40, 30, 340, 70)  # 300 px are 25 m at 12 px/m


@pytest.fixture
def plan(tmp_path, monkeypatch):
    """Return a plan at 12 px/m with a scale bar, below data/ of an empty project."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").mkdir()
    (tmp_path / "data/registry.txt").write_text("")
    picture = cv2.copyMakeBorder(
        plan_of(TEE, frame_for(TEE, px_per_m=12.0)), 100, 0, 0, 0, cv2.BORDER_CONSTANT, value=(255,) * 3
    )
    picture[BAR[1] + 10 : BAR[3] - 10, BAR[0] : BAR[2]] = 0
    cv2.imwrite("data/plan.png", picture)
    return picture


def read(**more):
    scale = more.pop("scale", {"source": "stated", "px_per_m": 12.0})
    params = {"kind": "plan", "name": "m", "image": "data/plan.png", "max_megapixels": 50, "scale": scale, **more}
    return read_here(PlanSurveyParams.model_validate(params).model_dump(mode="json")).values


@pytest.mark.parametrize(("width", "height", "by"), [(7000, 7000, 1), (7100, 7100, 2), (14_142, 14_142, 2)])
def test_a_picture_of_up_to_50_megapixels_is_read_whole_and_one_of_200_at_half_its_size(width, height, by):
    assert fitting_reduction(width, height) == by
    assert width * height / by**2 <= FITTING_PX


def test_a_reduced_pixel_is_the_mean_of_the_pixels_it_covers_and_the_last_ones_repeat_the_border():
    picture = np.random.default_rng(1).integers(0, 256, (1201, 35, 3)).astype(np.uint8)
    small = reduce_picture(picture, 2)
    assert small.shape == (601, 18, 3)
    means = picture[:1200, :34].reshape(600, 2, 17, 2, 3).mean(axis=(1, 3))
    assert np.abs(small[:600, :17] - means).max() <= 0.5
    assert np.abs(small[600, :17] - picture[1200, :34].reshape(17, 2, 3).mean(axis=1)).max() <= 0.5


@pytest.mark.parametrize(
    "scale",
    [
        {"source": "stated", "px_per_m": 12.0},
        {"source": "bar", "bar_box_px": (BAR[0] - 10, BAR[1], BAR[2] + 10, BAR[3]), "bar_length_m": 25.0},
    ],
)
def test_a_reduced_plan_has_the_scale_and_the_origin_of_the_whole(plan, scale):
    whole, half = (read(scale=scale, origin_px=(100.0, 200.0), reduction=by) for by in (1, 2))
    assert half["frame"]["px_per_m"] == pytest.approx(whole["frame"]["px_per_m"] / 2, rel=0.005)
    for side in ("width_px", "height_px"):
        assert abs(2 * half["frame"][side] - whole["frame"][side]) <= 1
    for place in ("origin_col", "origin_row"):
        assert 2 * half["frame"][place] == pytest.approx(whole["frame"][place])


def test_a_reduced_map_keeps_its_place(plan):
    Path("data/plan.pgw").write_text("0.1\n0\n0\n-0.1\n381000\n6290500\n")
    whole, half = (read(scale={"source": "georeference"}, origin_px=(50.0, 60.0), reduction=by) for by in (1, 2))
    assert half["georeference"]["origin"] == pytest.approx(whole["georeference"]["origin"])
    assert half["frame"]["px_per_m"] == pytest.approx(5.0)


def test_a_place_that_is_refused_is_named_by_the_px_of_the_whole_picture(plan):
    rows, cols = plan.shape[:2]
    with pytest.raises(InputError, match=rf"crop_px = \[0, 0, {cols + 1}, 9\]: not inside .* {cols} x {rows} px"):
        read(crop_px=(0, 0, cols + 1, 9), reduction=2)
    with pytest.raises(InputError, match=rf"bar_box_px = \[0, 0, {cols + 9}, 9\]: not inside"):
        read(scale={"source": "bar", "bar_box_px": (0, 0, cols + 9, 9)}, reduction=2)
    with pytest.raises(InputError, match=r"seeds_px.*\(px of the picture at 1/2 of its size\)"):
        read(line_drawing=True, seeds_px=[(0.0, 0.0)], reduction=2)


def test_options_in_px_are_converted_once():
    stated = {"source": "stated", "px_per_m": 12.0}
    params = PlanSurveyParams.model_validate(
        {
            "kind": "plan",
            "name": "m",
            "image": "data/x",
            "max_megapixels": 50,
            "scale": stated,
            "seeds_px": [(9.5, 19.5)],
            "wall_gap_px": 8.0,
            "reduction": 2,
        }
    )
    half = in_reduced_px(params)
    assert (half.scale.px_per_m, half.seeds_px, half.wall_gap_px) == (6.0, [(4.5, 9.5)], 4.0)
    resampled = params.model_copy(update={"resample_width_px": 500})
    assert in_reduced_px(resampled).scale.px_per_m == 12.0


def test_what_is_detected_of_a_large_picture_is_in_px_of_the_whole(plan, monkeypatch):
    whole = detect_here("data/plan.png", StatedOptions(bar_length_m=25.0).values()).values
    monkeypatch.setattr(reduction, "FITTING_PX", plan.shape[0] * plan.shape[1] / 3)
    half = detect_here("data/plan.png", StatedOptions(bar_length_m=25.0).values()).values
    assert "reduction" not in whole["values"]
    assert half["values"]["reduction"] == 2
    boxes = [np.array(found["values"]["scale"]["bar_box_px"]) for found in (whole, half)]
    assert np.abs(boxes[1] - boxes[0]).max() <= 8
    assert half["width_m"] == pytest.approx(whole["width_m"], rel=0.05)
    built = [read(**found["values"] | {"image": "data/plan.png"}) for found in (whole, half)]
    assert built[1]["frame"]["px_per_m"] == pytest.approx(built[0]["frame"]["px_per_m"] / 2, rel=0.01)


def test_a_crop_that_fits_is_read_at_full_size(plan, monkeypatch):
    monkeypatch.setattr(reduction, "FITTING_PX", plan.shape[0] * plan.shape[1] / 3)
    found = detect_here("data/plan.png", StatedOptions(px_per_m=12.0, crop_px=(0, 100, 400, 500)).values()).values
    assert "reduction" not in found["values"]
