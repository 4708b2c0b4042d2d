"""How far two pixel masks agree: intersection over union, and the areas in which they differ."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.types import Frame, Mask


def intersection_over_union(one: Mask, two: Mask) -> float:
    """Return |one and two| / |one or two| over all pixels; 1 when both are empty.

    References
    ----------
    Jaccard 1912, doi:10.1111/j.1469-8137.1912.tb05611.x
    """
    union = np.count_nonzero(one | two)
    return 1.0 if union == 0 else np.count_nonzero(one & two) / union


@dataclass(frozen=True)
class DifferingAreas:
    """Where a world and a plan differ: rock in the plan's free space, m2 and share of it, and missing rock, m2."""

    rock_in_free_m2: float
    rock_in_free_share: float
    missing_rock_m2: float


def differing_areas(world_free: Mask, plan_free: Mask, px_per_m: float) -> DifferingAreas:
    """Return the areas in which the free pixels of a world and of a plan differ."""
    rock, missing = (
        int(np.count_nonzero(one & ~two)) for one, two in ((plan_free, world_free), (world_free, plan_free))
    )
    return DifferingAreas(
        round(rock / px_per_m**2, 3),
        round(rock / max(1, int(np.count_nonzero(plan_free))), 6),
        round(missing / px_per_m**2, 3),
    )


def plan_iou(seen: Mask, cleaned: Mask, raw: Mask) -> dict[str, float]:
    """Return the IoU of the floor that is seen from above with the cleaned plan and the raw one, and that of rock.

    All are masks (rows, cols) on the plan's pixels.
    """
    return {
        "free_space_vs_cleaned": round(intersection_over_union(seen, cleaned), 6),
        "free_space_vs_raw": round(intersection_over_union(seen, raw), 6),
        "rock": round(intersection_over_union(~seen, ~cleaned), 6),
    }


def joined_to(mask: Mask, frame: Frame, place_m: tuple[float, float]) -> Mask:
    """Return the piece of a mask (rows, cols) whose pixels are joined by their sides to a place, m, mine frame."""
    col, row = np.floor(frame.to_image(np.array([place_m]))[0]).astype(int)
    _, piece = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
    return mask & (piece == piece[row, col])
