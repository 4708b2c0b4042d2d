"""How a survey's distances to walls, roof and floor are known: measured, interpolated or assumed."""

from __future__ import annotations

import numpy as np

from pipeline.survey.passages.legs import SurveyLeg
from pipeline.types import Source


def known_of(leg: SurveyLeg) -> np.ndarray:
    """Return how the distances left, right, up and down (n, 4) of the places of a leg are known (`Source`).

    Roofs that nobody measured are interpolated where half of the leg's stations or more have one.
    """
    known = leg.known.astype(np.uint8)
    roofs = known[:, 2] == Source.MEASURED
    known[~roofs, 2] = Source.INTERPOLATED if 2 * roofs[leg.surveyed].mean() >= 1 else Source.ASSUMED
    return known
