"""How a survey's distances to walls, roof and floor are known: measured, interpolated or assumed."""

from __future__ import annotations

import numpy as np

from pipeline.survey.passages.legs import SurveyLeg, says_enough
from pipeline.types import Known


def known_along(distances: np.ndarray) -> np.ndarray:
    """Return how each of the distances (n,) along a row of stations is known, as `along_stations` fills them."""
    otherwise = Known.INTERPOLATED if says_enough(distances) else Known.ASSUMED
    return np.where(np.isfinite(distances), Known.MEASURED, otherwise).astype(np.uint8)


def known_of(leg: SurveyLeg) -> np.ndarray:
    """Return how the distances left, right, up and down (n, 4) at the stations of a leg are known.

    Walls and floors that are still missing are assumed; missing roofs are as `known_along` has them.
    """
    heights = np.full((len(leg.stations), 3), np.nan) if leg.heights_m is None else leg.heights_m
    lrud = np.column_stack([leg.walls_m, heights[:, 1:]])
    missing = np.full_like(lrud, Known.ASSUMED, dtype=np.uint8)
    missing[:, 2] = known_along(lrud[:, 2])
    return np.where(np.isfinite(lrud), 0 if leg.known is None else leg.known, missing).astype(np.uint8)
