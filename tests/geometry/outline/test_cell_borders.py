"""Borders of cells beside those that OpenCV finds."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from pipeline.geometry.outline.cell_borders import RowEnds, fill_contacts, trace_borders


def doubled(mask):
    return np.pad(mask, 1).astype(np.uint8).repeat(2, axis=0).repeat(2, axis=1)


def cells_of(ends, shape):
    row, col = np.indices(shape)
    return ends.is_true(row, col)


@given(seed=st.integers(0, 10_000), blurred=st.booleans())
@settings(deadline=None, max_examples=60)
def test_borders_and_their_regions_are_those_of_opencv(seed, blurred):
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=rng.integers(2, 40, 2))
    mask = (gaussian_filter(noise, 1.5) if blurred else noise) > 0
    ends = fill_contacts(RowEnds.doubled(mask))
    cells = cells_of(ends, doubled(mask).shape)
    contours, hierarchy = cv2.findContours(cells.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    found = trace_borders(ends)
    number = {ring.tobytes(): k for k, ring in enumerate(ring.astype(np.int32) for ring in found.rings)}
    order = [number[np.ascontiguousarray(contour[:, 0]).tobytes()] for contour in contours]
    assert sorted(order) == list(range(len(found.rings)))
    for k, ring in enumerate(order):
        parent = hierarchy[0][k][3]
        assert found.is_hole[ring] == (parent >= 0)
        assert parent < 0 or found.region[ring] == found.region[order[parent]]
    assert len(set(found.region[~found.is_hole])) == np.count_nonzero(~found.is_hole)


@pytest.mark.parametrize("mask", [np.eye(4, dtype=bool), np.indices((5, 5)).sum(axis=0) % 2 == 0])
def test_cells_that_touch_at_a_corner_are_joined_by_the_cells_about_it(mask):
    assert (cells_of(RowEnds.doubled(mask), doubled(mask).shape) == doubled(mask)).all()
    ends = fill_contacts(RowEnds.doubled(mask))
    cells = cells_of(ends, doubled(mask).shape)
    a, b, c, d = cells[:-1, :-1], cells[:-1, 1:], cells[1:, :-1], cells[1:, 1:]
    assert not ((a & d & ~b & ~c) | (b & c & ~a & ~d)).any()
    assert (cells >= doubled(mask).astype(bool)).all()
    assert len(set(trace_borders(ends).region)) == 1
