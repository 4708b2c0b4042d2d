import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from pipeline.geometry.rasterize import fill_polygon
from pipeline.types import Frame
from tests.mines import RING, frame_for, random_mine


def test_the_pixels_of_a_box_on_the_grid_have_exactly_its_area():
    frame = frame_for(shapely.box(0, 0, 10, 4))
    assert fill_polygon(shapely.box(0, 0, 10, 4), frame).sum() == 10 * 4 * 8 * 8


def test_a_hole_is_not_filled():
    frame = frame_for(RING)
    assert fill_polygon(RING, frame).sum() == round(RING.area * 64)


@given(seed=st.integers(0, 1000))
def test_a_pixel_is_filled_when_its_centre_lies_inside(seed):
    mine = random_mine(np.random.default_rng(seed), 3)
    frame = frame_for(mine, px_per_m=2.0)
    cols, rows = np.meshgrid(np.arange(frame.width_px) + 0.5, np.arange(frame.height_px) + 0.5)
    centres = frame.to_mine(np.column_stack([cols.ravel(), rows.ravel()]))
    inside = shapely.contains_xy(mine, centres).reshape(rows.shape)
    assert (fill_polygon(mine, frame) == inside).all()


def test_nothing_outside_the_frame_is_drawn():
    frame = Frame(1.0, 0.0, 10.0, 10, 10)
    assert fill_polygon(shapely.box(-5, -5, 20, 20), frame).all()
    assert not fill_polygon(shapely.box(20, 20, 30, 30), frame).any()
