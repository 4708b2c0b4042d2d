import cv2
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import GeometryError
from pipeline.geometry.outline.binarize import binarize
from pipeline.geometry.outline.half_level import cover_of, trace_half_level
from pipeline.geometry.outline.trace import trace_outline
from pipeline.geometry.rasterize import fill_polygon
from pipeline.metrics.wall_error import signed_distances
from pipeline.survey.draw import draw_picture
from tests.mines import RING, STRAIGHT, TEE, frame_for, random_mine

DRAWN = {"sharp": (False, None), "anti-aliased": (True, None), "JPEG": (True, 80), "sharp JPEG": (False, 80)}


def trace(mine, frame, drawn):
    plan = draw_picture(mine, frame, 40, *DRAWN[drawn])
    raw = binarize(plan, None, 40, 0, [])
    return trace_half_level(cover_of(plan, raw, raw), frame)


# By the pixels a metre, the scale of the mine: one of half the size has pixels enough at 20. The error is in pixels, so
# one of them in the fast run shows it.
SMALLER = {4.0: 1.0, 8.0: 1.0, 20.0: 0.5}


@pytest.mark.parametrize("px_per_m", [4.0, *(pytest.param(finer, marks=pytest.mark.slow) for finer in (8.0, 20.0))])
@pytest.mark.parametrize("drawn", DRAWN)
def test_the_wall_of_a_polygon_in_any_rotation_is_traced_within_015_pixels(drawn, px_per_m):
    squares = []
    for angle in np.random.default_rng(0).uniform(0, 90, 8):
        tee = shapely.affinity.scale(TEE, SMALLER[px_per_m], SMALLER[px_per_m])
        mine = shapely.affinity.rotate(tee, angle, origin=(0.3, 0.7))
        traced = trace(mine, frame_for(mine, px_per_m), drawn)
        squares.append((signed_distances(mine, traced) ** 2).mean())
    assert px_per_m * np.sqrt(np.mean(squares)) <= 0.15


@pytest.mark.parametrize(("angle", "apart_px"), [(0, 0.9), (45, 0.6)])
def test_a_black_and_white_picture_does_not_hold_where_a_level_or_diagonal_wall_lies(angle, apart_px):
    frame = frame_for(shapely.box(0, 0, 40, 40), 10.0)
    walls = []
    for shift_px in (0.05, 0.05 + apart_px):  # of the wall from a row of pixel centres
        rock = shapely.box(-100, -100, 100, 0)
        wall = shapely.affinity.rotate(shapely.affinity.translate(rock, 0, shift_px / 10.0), angle, origin=(0, 0))
        walls.append(shapely.affinity.translate(wall, 20.05, 20.05))
    assert (fill_polygon(walls[0], frame) == fill_polygon(walls[1], frame)).all()
    assert walls[0].exterior.hausdorff_distance(walls[1].exterior) == pytest.approx(apart_px / 10.0)


def test_the_border_of_pixels_is_farther_from_the_wall_than_the_half_level():
    mine = shapely.affinity.rotate(TEE, 27, origin=(0, 0))
    frame = frame_for(mine)
    by_pixels = trace_outline(fill_polygon(mine, frame), frame)
    errors = [np.abs(signed_distances(mine, other)).mean() for other in (by_pixels, trace(mine, frame, "sharp"))]
    assert errors[1] < 0.4 * errors[0]


@pytest.mark.parametrize("mine", [STRAIGHT, RING, TEE], ids=["straight", "ring", "tee"])
def test_a_mine_on_the_pixel_grid_keeps_its_walls_and_loses_only_its_corners(mine):
    traced = trace(mine, frame_for(mine), "anti-aliased")
    assert len(traced.interiors) == len(mine.interiors)
    assert traced.symmetric_difference(mine).area <= 12 * (1 / 8) ** 2


@given(seed=st.integers(0, 10_000), drifts=st.integers(1, 6), drawn=st.sampled_from(list(DRAWN)))
@settings(deadline=None, max_examples=20)
def test_the_half_level_has_the_masks_islands_and_differs_at_few_border_pixels(seed, drifts, drawn):
    mine = random_mine(np.random.default_rng(seed), drifts)
    frame = frame_for(mine, px_per_m=4.0)
    plan = draw_picture(mine, frame, 40, *DRAWN[drawn])
    raw = binarize(plan, None, 40, 0, [])
    _, labels, stats, _ = cv2.connectedComponentsWithStats(raw.astype(np.uint8), connectivity=4)
    mask = labels == 1 + stats[1:, cv2.CC_STAT_AREA].argmax()
    traced = trace_half_level(cover_of(plan, raw, mask), frame)
    _, islands = cv2.connectedComponents((~np.pad(mask, 1)).astype(np.uint8), connectivity=8)
    assert len(traced.interiors) == islands.max() - 1
    differ = fill_polygon(traced, frame) != mask
    square = np.ones((3, 3), np.uint8)
    border = cv2.dilate(mask.astype(np.uint8), square) > cv2.erode(mask.astype(np.uint8), square)
    assert not (differ & ~border).any()
    assert differ.sum() <= 0.06 * border.sum()  # the border is two pixels wide


def test_a_pillar_and_a_drift_of_two_pixels_survive():
    mask = np.zeros((40, 60), dtype=bool)
    mask[10:30, 5:30] = mask[19:21, 30:55] = True
    mask[15:25, 15:17] = False
    traced = trace_half_level(mask.astype(np.float32), frame_for(shapely.box(0, 0, 1, 1), 1.0))
    assert len(traced.interiors) == 1
    assert traced.area == pytest.approx(mask.sum(), rel=0.03)


def test_grey_values_of_annotation_over_the_workings_do_not_move_the_wall():
    mine = shapely.box(0.13, 0.13, 40.13, 5.13)
    frame = frame_for(mine)
    plan = draw_picture(mine, frame, 40, True, None)
    cv2.putText(plan, "A", (100, 70), cv2.FONT_HERSHEY_SIMPLEX, 2.0, (0, 0, 255), 4, cv2.LINE_AA)
    raw = binarize(plan, None, 40, 2, [])
    traced = trace_half_level(cover_of(plan, raw, fill_polygon(mine, frame)), frame)
    assert np.abs(signed_distances(mine, traced)).max() <= 1.0 / frame.px_per_m


def test_an_empty_cover_is_refused():
    with pytest.raises(GeometryError, match="no free region"):
        trace_half_level(np.zeros((9, 9), dtype=np.float32), frame_for(STRAIGHT))
