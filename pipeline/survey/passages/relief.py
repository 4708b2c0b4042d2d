"""Whether the legs of a survey rise or fall: then they are built as one volume, else as a level plan."""

from __future__ import annotations

import numpy as np

from pipeline.params.floor_rules import floor_rules
from pipeline.survey.passages.legs import SurveyLeg


def floor_of(leg: SurveyLeg) -> np.ndarray:
    """Return the floor's height (n,) m at the stations of a leg; a station without a distance down is on the floor."""
    assert leg.heights_m is not None
    elevation, _, down = leg.heights_m.T
    known = np.flatnonzero(np.isfinite(down))
    filled = np.interp(np.arange(len(down)), known, down[known]) if len(known) else np.zeros(len(down))
    return np.asarray(elevation - filled)


def has_relief(legs: list[SurveyLeg]) -> bool:
    """Return whether a survey has grades, or floors that differ in height by `flat_step_m` or more; else it is flat.

    A shaft has relief. Legs without elevations have none, also where `flat_step_m` is 0.
    """
    if any(leg.heights_m is None for leg in legs):
        return False
    if any(leg.grades is not None for leg in legs):
        return True
    floors = np.concatenate([floor_of(leg) for leg in legs])
    return bool(np.isfinite(floors).all() and np.ptp(floors) >= floor_rules().flat_step_m)
