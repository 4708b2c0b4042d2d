"""Sorting of whole numbers by their digits."""

import numpy as np
import pytest

from pipeline.geometry.sorting import stable_order


@pytest.mark.parametrize("most", [1, 3, 1 << 16, 1 << 20, 1 << 40, 1 << 62])
def test_the_order_is_that_of_a_stable_sort(most):
    numbers = np.random.default_rng(5).integers(0, most, 20_000, endpoint=True)
    assert (stable_order(numbers) == np.argsort(numbers, kind="stable")).all()


def test_no_numbers_have_an_empty_order():
    assert len(stable_order(np.zeros(0, np.int64))) == 0
