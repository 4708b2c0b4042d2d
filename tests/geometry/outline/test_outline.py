import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import GeometryError
from pipeline.geometry.network.skeleton import require_same_network, trace_network
from pipeline.geometry.outline.trace import grid_m, simplify_outline, trace_outline
from pipeline.geometry.rasterize import fill_polygon
from tests.mines import RING, STRAIGHT, TEE, frame_for, random_mine


@pytest.mark.parametrize("mine", [STRAIGHT, RING, TEE], ids=["straight", "ring", "tee"])
def test_a_mine_on_the_pixel_grid_is_traced_exactly(mine):
    frame = frame_for(mine)
    traced = trace_outline(fill_polygon(mine, frame), frame)
    # Exact, except that each re-entrant corner is cut by half a sub-pixel (a sub-pixel is half a pixel).
    assert traced.symmetric_difference(mine).area <= 4 * 0.5 * (0.5 / frame.px_per_m) ** 2
    assert len(traced.interiors) == len(mine.interiors)


@given(seed=st.integers(0, 10_000), drifts=st.integers(1, 6))
@settings(deadline=None, max_examples=40)
def test_tracing_and_rasterising_gives_the_same_pixels(seed, drifts):
    mine = random_mine(np.random.default_rng(seed), drifts)
    frame = frame_for(mine, px_per_m=4.0)
    mask = fill_polygon(mine, frame)
    again = fill_polygon(trace_outline(mask, frame), frame)
    # Only corners where two pixels touch are filled on purpose.
    assert (again != mask).mean() < 1e-4


def test_an_outline_of_single_pixels_and_corner_contacts_is_still_valid():
    mask = np.zeros((20, 20), dtype=bool)
    mask[5, 5] = mask[6, 6] = mask[7, 7] = mask[8, 6] = True
    mask[7, 5:15] = True
    assert trace_outline(mask, frame_for(shapely.box(0, 0, 1, 1))).is_valid


def test_an_empty_mask_is_refused():
    with pytest.raises(GeometryError, match="no free region"):
        trace_outline(np.zeros((9, 9), dtype=bool), frame_for(STRAIGHT))


@given(seed=st.integers(0, 10_000), drifts=st.integers(1, 6), tolerance=st.sampled_from([0.1, 0.2, 0.5]))
@settings(deadline=None, max_examples=40)
def test_simplification_keeps_islands_validity_and_its_tolerance(seed, drifts, tolerance):
    mine = random_mine(np.random.default_rng(seed), drifts)
    frame = frame_for(mine, px_per_m=8.0)
    traced = trace_outline(fill_polygon(mine, frame), frame)
    simple = simplify_outline(traced, tolerance)
    assert simple.is_valid
    assert len(simple.interiors) == len(traced.interiors)
    assert shapely.hausdorff_distance(traced.boundary, simple.boundary) <= tolerance + 2 * grid_m(traced)


def test_six_digits_hold_every_coordinate_of_a_simplified_outline_exactly():
    frame = frame_for(TEE, px_per_m=7.82)
    simple = simplify_outline(trace_outline(fill_polygon(TEE, frame), frame), 0.2)
    coordinates = shapely.get_coordinates(simple).ravel()
    assert all(float(f"{v:.6g}") == v for v in coordinates)


def test_the_grid_is_a_millimetre_up_to_a_kilometre_and_a_centimetre_beyond():
    assert grid_m(shapely.box(0, 0, 700, 10)) == pytest.approx(1e-3)
    assert grid_m(shapely.box(0, 0, 5000, 10)) == pytest.approx(1e-2)


def test_a_tolerance_that_closes_a_drift_is_refused():
    stub = shapely.union_all([STRAIGHT, shapely.box(50, 5, 52, 15)])
    frame = frame_for(stub)
    traced = trace_outline(fill_polygon(stub, frame), frame)
    simple = simplify_outline(traced, 12.0)
    before = trace_network(traced, 0.25, 2.0, 3.0)
    with pytest.raises(GeometryError, match=r"tolerance_m = 12 would change the topology"):
        require_same_network(before, trace_network(simple, 0.25, 2.0, 3.0), simple, "contours.tolerance_m = 12", 2.0)
