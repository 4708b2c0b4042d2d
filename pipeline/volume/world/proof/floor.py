"""The figures of the certificate of a volume world on how its floors follow the survey, with their places."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from minesurveys.errors import first_few
from minesurveys.remarks import warn_user
from minexplore.floors.volume_arrays import VolumeFacets
from pipeline.volume.floor_error import measure_floor
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.union import pieces_of
from pipeline.volume.world.content import closed_volume

_MM = 1e3
_ASSUMED = ", whose roof is assumed"


def floor_figures(network: SurveyNetwork, offset: np.ndarray, mine: VolumeFacets) -> dict[str, Any]:
    """Return how the floors follow a survey's network, which an offset (3,) m moves into the mine frame."""
    about = closed_volume(dataclasses.replace(mine, vertices=mine.vertices - offset))
    about = dataclasses.replace(about, pieces=pieces_of(network))  # the first of them are the legs, by number
    found = measure_floor(about, network)
    through = [
        *(
            f"{k.leg} through {k.other} ({k.off_m:+.2f} m at {_at(k.place_m, offset)}{_ASSUMED * k.is_assumed})"
            for k in found.elsewhere
        ),
        *(f"{k.leg} on {k.other} ({k.step_m:.2f} m at {_at(k.place_m, offset)})" for k in found.ledges if not k.meet),
    ]
    if through:
        assumed = sum(k.is_assumed for k in found.elsewhere)
        why = f", {assumed} of them under an assumed roof (up_m, compile3d.height_m)" if assumed else ", as surveyed"
        named = first_few(through)
        warn_user(
            f"pairs of legs break through each other's floors{why}: {named}",
            of="validation",
            count=len(through),
            option="compile3d.height_m" if assumed else "",
        )
    figures = {
        "error_mm": round(_MM * found.error_m, 6),
        "median_mm": round(_MM * found.median_m, 6),
        "over_1cm": round(found.over_1cm, 6),
        "step_mm": round(_MM * found.step_m, 6),
        "other_step_mm": round(_MM * found.other_step_m, 6),
        "steep_share": round(found.steep_share, 6),
        "tracks_mm": round(_MM * found.tracks_m, 6),
        "steepest": round(found.steepest, 6),
        "in_other_workings": len(found.elsewhere),
        "in_other_workings_share": round(found.elsewhere_share, 6),
        **({"through": through} if through else {}),
        "ledges": len(found.ledges),
    }
    places = {"error_at": found.error_at, "step_at": found.step_at}
    return figures | {k: f"{at.legs} at {_at(at.place_m, offset)}" for k, at in places.items() if at is not None}


def _at(place_m: list[float], offset: np.ndarray) -> str:
    """Return a place about the survey's middle as text: in the mine frame, which is moved by `offset` (3,) m."""
    return "({:.2f}, {:.2f}, {:.2f}) m".format(*(np.array(place_m) + offset))
