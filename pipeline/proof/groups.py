"""The groups of stage 6's metrics: which are measured of a world, and which limits apply to it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.params.validation import Limit, ValidationParams

_OF_ROCK = ("texture", "relief")
_OF_VISIBLE_ROCK = (*_OF_ROCK, "walls")
_OF_CERTIFICATE = ("areas", "collision", "certificate")
GROUPS = (
    *(
        "iou",
        "against_plan",
        "wall_error",
        "navigability",
        "topology",
        "areas",
        "collision",
        "per_m2",
        "certificate",
    ),
    *(*_OF_VISIBLE_ROCK, "scale", "world"),
)


def groups_of(params: ValidationParams) -> list[str]:
    """Return the groups of metrics that are measured: without visible rock, or by the certificate alone, not all."""
    groups = [name for name in GROUPS if params.overlay != "none" or name not in _OF_VISIBLE_ROCK]
    return groups if params.extent == "full" else [name for name in groups if name in _OF_CERTIFICATE]


def is_rock_judged(params: ValidationParams, figures: Mapping[str, Any]) -> bool:
    """Return whether a mine has drifts for one whole draw of stretches of rock, by its flat figures.

    The limits on texture and relief are those of such draws. In a shorter mine both are measured and not judged: a
    single block decides about them.
    """
    drift_m = figures.get("topology.drift_m")
    return drift_m is None or drift_m >= params.texture.draw_m


def applying_limits(params: ValidationParams, figures: Mapping[str, Any]) -> dict[str, Limit]:
    """Return the limits on the groups of metrics that are measured and judged, by the mine's flat figures."""
    left_out = set(GROUPS) - set(groups_of(params))
    if not is_rock_judged(params, figures):
        left_out |= set(_OF_ROCK)
    return {name: limit for name, limit in params.limits.items() if name.partition(".")[0] not in left_out}
