"""Photographs of plans: their light is evened out; flat scans and drawings stay as they are."""

import cv2
import numpy as np
import pytest
import shapely

from minesurveys.errors import DoubtError
from minesurveys.pictures.image import read_pixels
from pipeline.errors import InputError
from pipeline.geometry.outline.binarize import binarize
from pipeline.geometry.rasterize import fill_polygon
from pipeline.metrics.iou import intersection_over_union as iou
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import PlanSurveyParams
from pipeline.survey.detection.picture import detect_picture
from pipeline.survey.drawing.light import even_light, is_light_on_dark
from pipeline.survey.scaled import read_plan
from tests.mines import RING, TEE, frame_for, plan_of

ROOMS = shapely.box(0, 0, 60, 45).difference(
    shapely.union_all([shapely.box(x, y, x + 9, y + 8) for x in range(6, 50, 15) for y in range(6, 35, 14)])
)


def photographed(plan, lost=0.6, shadow=0.5, sigma=12.0, dim=1.0, seed=0):
    """Return a plan as a phone sees it: light that falls off, dark corners, a shadow over one, noise, JPEG."""
    rows, cols = plan.shape[:2]
    y, x = np.mgrid[0 : 1 : rows * 1j, 0 : 1 : cols * 1j]
    light = dim * (1 - lost * (0.8 * x + 0.2 * y)) * (1 - 0.4 * ((x - 0.5) ** 2 + (y - 0.5) ** 2))
    light *= 1 - shadow * cv2.GaussianBlur((x + 0.7 * y > 1.15).astype(float), (0, 0), 12)
    noise = np.random.default_rng(seed).normal(0, sigma, plan.shape)
    picture = np.clip(plan * (235 / 255) * light[..., None] + noise, 0, 255).astype(np.uint8)
    return cv2.imdecode(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 70])[1], cv2.IMREAD_COLOR)


def read(path):
    """Return the workings of a picture as detection and stage 1 read them, and its section."""
    values = detect_picture(path, StatedOptions(px_per_m=8.0)).values
    plan = read_plan(PlanSurveyParams.model_validate({**values, "name": "m", "image": f"data/{path.name}"})).plan
    return binarize(plan, None, 40, 2.0, []), values


@pytest.mark.parametrize(("lost", "shadow"), [(0.3, 0.0), (0.6, 0.0), (0.0, 0.5), (0.6, 0.5)])
@pytest.mark.parametrize("mine", [TEE, RING, ROOMS], ids=["tee", "ring", "rooms"])
def test_a_photograph_is_read_as_the_flat_scan_is(data, capsys, mine, lost, shadow):
    frame = frame_for(mine, margin_m=8.0)
    plan = plan_of(mine, frame)
    cv2.imwrite(str(data / "flat.png"), plan)
    cv2.imwrite(str(data / "photo.png"), photographed(plan, lost, shadow))
    flat, _ = read(data / "flat.png")
    assert "light is uneven" not in capsys.readouterr().err
    found, values = read(data / "photo.png")
    assert "photo.png: light is uneven, as in a photograph, and is evened out: the darkest" in capsys.readouterr().err
    assert not values["light_on_dark"]
    assert (flat == fill_polygon(mine, frame)).all()
    assert iou(found, flat) > 0.99
    assert found.sum() == pytest.approx(flat.sum(), rel=0.01)


def test_how_dark_the_paper_gets_counts_the_gradient_and_the_shadow_together():
    plan = plan_of(TEE, frame_for(TEE))
    gradient, both = (even_light(photographed(plan, 0.5, shadow))[1] for shadow in (0.0, 0.5))
    assert gradient == pytest.approx(0.5, abs=0.06)
    assert both == pytest.approx(0.25, abs=0.06)


def test_warm_light_is_no_coloured_annotation_and_red_letters_stay_red(data):
    plan = plan_of(TEE, frame_for(TEE))
    plan[20:60, 20:120] = (30, 30, 220)
    cv2.imwrite(str(data / "photo.png"), photographed((plan * [0.6, 0.8, 1.0]).astype(np.uint8), sigma=3.0, shadow=0.0))
    found, _ = read(data / "photo.png")
    assert iou(found, fill_polygon(TEE, frame_for(TEE))) > 0.98


def test_a_wide_room_and_a_dim_photograph_are_read(data):
    room = shapely.box(0, 0, 40, 20)
    plan = plan_of(room, frame_for(room))
    cv2.imwrite(str(data / "photo.png"), photographed(plan, shadow=0.0, sigma=4.0, dim=0.5))
    found, values = read(data / "photo.png")
    assert not values["light_on_dark"]
    assert iou(found, fill_polygon(room, frame_for(room))) > 0.98


def test_the_walls_of_a_line_drawing_are_read_in_a_photograph(data):
    frame = frame_for(RING, 16.0)
    plan = np.full((frame.height_px, frame.width_px, 3), 255, np.uint8)
    for ring in (RING.exterior, *RING.interiors):
        points = np.round(frame.to_image(np.array(ring.coords)) - 0.5).astype(np.int32)
        cv2.polylines(plan, [points], True, (0, 0, 0), 3)
    cv2.imwrite(str(data / "photo.png"), photographed(plan, 0.5, 0.4, sigma=5.0))
    seed = tuple(frame.to_image(np.array([[1.0, 1.0]]))[0])
    values = detect_picture(data / "photo.png", StatedOptions(px_per_m=16.0, seeds_px=[seed])).values
    plan = read_plan(PlanSurveyParams.model_validate({**values, "name": "m", "image": "data/photo.png"})).plan
    assert iou(binarize(plan, None, 40, 2.0, []), fill_polygon(RING, frame)) > 0.97


def flat_pictures():
    """Return pictures that no light needs to be evened in, by name."""
    plan = plan_of(RING, frame_for(RING))
    tinted = np.where(plan < 128, 205, plan).astype(np.uint8)
    tinted[:, :200] = np.minimum(tinted[:, :200], 228)
    noise = np.random.default_rng(1).normal(0, 12, plan.shape)
    noisy = np.clip(plan * 0.9 + noise, 0, 255).astype(np.uint8)
    slightly = np.clip(plan * np.linspace(1, 0.88, plan.shape[1])[None, :, None], 0, 255).astype(np.uint8)
    return {"plan": plan, "tinted": tinted, "inverted": 255 - plan, "noisy": noisy, "slightly": slightly}


@pytest.mark.parametrize("name", flat_pictures())
def test_flat_scans_and_drawings_stay_as_they_are(name):
    picture = flat_pictures()[name]
    same, darkest = even_light(picture)
    assert same is picture
    assert darkest == 1.0
    assert is_light_on_dark(picture) == (name == "inverted")


def test_a_blueprint_in_uneven_light_is_light_on_dark():
    plan = plan_of(RING, frame_for(RING))
    blueprint = np.where(plan < 128, 230, 70).astype(np.uint8)
    assert is_light_on_dark(photographed(blueprint, 0.5, 0.0))
    assert not is_light_on_dark(photographed(plan, 0.6, 0.5, dim=0.5))


@pytest.mark.parametrize("white", [255, 1023, 4095, 65535])
def test_a_picture_of_16_bits_that_uses_fewer_is_read(data, white):
    frame = frame_for(TEE)
    stored = np.where(plan_of(TEE, frame) < 128, white // 8, white).astype(np.uint16)
    cv2.imwrite(str(data / "plan.png"), stored)
    found, values = read(data / "plan.png")
    assert not values["light_on_dark"]
    assert (found == fill_polygon(TEE, frame)).all()
    dark = stored // 200  # an occupancy grid states shares of the full range
    cv2.imwrite(str(data / "map.png"), dark)
    assert read_pixels(data / "map.png", 1.0).max() == dark.max() // 257


def test_white_lines_on_transparent_ground_are_refused_with_what_to_do(data):
    plan = plan_of(TEE, frame_for(TEE))
    opaque = np.where(plan[..., :1] < 128, 255, 0)
    cv2.imwrite(str(data / "white.png"), np.dstack([np.full_like(plan, 255), opaque]).astype(np.uint8))
    with pytest.raises(InputError, match="lines are white, and so is what is transparent in it; save it on a dark"):
        detect_picture(data / "white.png", StatedOptions(px_per_m=8.0))
    assert (read_pixels(data / "white.png", 1.0) == 255).all()


@pytest.mark.parametrize("ink", [10, 60])
def test_a_dim_flat_scan_is_dark_on_light(data, ink):
    frame = frame_for(TEE)
    cv2.imwrite(str(data / "dim.png"), np.where(plan_of(TEE, frame) < 128, ink, 110).astype(np.uint8))
    found, values = read(data / "dim.png")
    assert not values["light_on_dark"]
    assert iou(found, fill_polygon(TEE, frame)) > 0.99


@pytest.mark.parametrize("seed", range(3))
def test_a_photograph_without_a_plan_is_refused_with_what_to_do(data, seed):
    blank = np.full((400, 500, 3), 255, np.uint8)
    cv2.imwrite(str(data / "photo.png"), photographed(blank, seed=seed))
    with pytest.raises(InputError, match=r"photo\.png: .*scan the plan, or photograph it flat in even light$") as error:
        detect_picture(data / "photo.png", StatedOptions(px_per_m=8.0))
    assert "\n" not in str(error.value)


def test_a_doubt_about_a_photograph_names_its_light(data):
    frame = frame_for(TEE)
    pair = np.hstack([plan_of(TEE, frame)] * 2)
    for k in range(40):
        cv2.line(pair, (20 + 30 * k, 0), (5 + 30 * k, 380), (60, 60, 60), 3)
    cv2.imwrite(str(data / "photo.png"), photographed(pair, sigma=3.0))
    with pytest.raises(DoubtError, match="uneven, as in a photograph: scan the plan"):
        detect_picture(data / "photo.png", StatedOptions(px_per_m=8.0))
