"""The groups of stage 6's metrics: which are measured of a world, and which limits apply to it."""

from __future__ import annotations

from pipeline.params.validation import Limit, ValidationParams

_OF_VISIBLE_ROCK = ("texture", "relief", "walls")
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


def applying_limits(params: ValidationParams) -> dict[str, Limit]:
    """Return the limits on the groups of metrics that are measured."""
    left_out = set(GROUPS) - set(groups_of(params))
    return {name: limit for name, limit in params.limits.items() if name.partition(".")[0] not in left_out}
