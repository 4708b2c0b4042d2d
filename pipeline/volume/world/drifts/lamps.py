"""Where the lights of a volume hang: along its drifts, as in a level mine, below the roof."""

from __future__ import annotations

import numpy as np

from pipeline.geometry.network.leg_graph import LegGraph
from pipeline.geometry.network.skeleton import main_drift
from pipeline.geometry.polyline import arc_length
from pipeline.mjcf.scene import SpotLight, place_lights
from pipeline.params.realism import LightParams
from pipeline.volume.world.drifts.ways import Drift, drifts_along
from pipeline.volume.world.topology import LegNetwork

_ROOF_SHARE = 0.8  # of the way to the roof that lights hang at most
_PLUMB_M = 0.5  # in plan: a shorter drift is a shaft, which has no light
SPACING_DIGITS = 3  # of the distance between lights: it can be read off their places, which have as many


def lights_of(params: LightParams, legs: LegNetwork) -> list[SpotLight]:
    """Return spot lights along the drifts, as high over their floors as stated, or below a lower roof."""
    return place_lights(
        lit_lines(legs, params.along),
        round(params.spacing_m, SPACING_DIGITS),
        params.height_m,
        params.pitch_deg,
        params.cutoff_deg,
        params.count,
    )


def lit_lines(legs: LegNetwork, along: str) -> list[np.ndarray]:
    """Return what `place_lights` takes: the main drift alone, or each drift that is no shaft."""
    drifts = drifts_along(legs)
    lines = [_main(drifts)] if along == "main_drift" and drifts else [_line(drift) for drift in drifts]
    return [line for line in lines if arc_length(line[:, :2])[-1] >= _PLUMB_M]


def _line(drift: Drift) -> np.ndarray:
    return np.column_stack([drift.way.floor_m, _ROOF_SHARE * drift.headroom_m])


def _main(drifts: list[Drift]) -> np.ndarray:
    """Return the longest of the shortest ways in plan between two junctions or ends, from west to east."""
    graph, number = LegGraph(), {name: k for k, name in enumerate(sorted({end for d in drifts for end in d.ends}))}
    lines = [(drift.ends, _line(drift)) for drift in drifts]
    for ends, line in lines:
        for name, place in zip(ends, line[[0, -1]], strict=True):
            graph.places_m.setdefault(number[name], place)
            graph.legs_at.setdefault(number[name], [])
    for (start, end), line in lines:
        graph.add_leg(number[start], number[end], line)
    return main_drift(graph)[1]
