"""Intersection over union of pixel masks."""

from __future__ import annotations

import numpy as np

from pipeline.types import Mask


def intersection_over_union(one: Mask, two: Mask) -> float:
    """Return |one and two| / |one or two| over all pixels; 1 when both are empty.

    References
    ----------
    Jaccard 1912, doi:10.1111/j.1469-8137.1912.tb05611.x
    """
    union = np.count_nonzero(one | two)
    return 1.0 if union == 0 else np.count_nonzero(one & two) / union
