"""The groups of stage 6's metrics: which are measured of a world, and which limits apply to it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.params.validation import Limit, ValidationParams

_OF_ROCK = ("texture", "relief")
OF_VISIBLE_ROCK = (*_OF_ROCK, "walls")
_OF_CERTIFICATE = ("areas", "collision", "certificate")


def is_measured(group: str, params: ValidationParams) -> bool:
    """Return whether a group of metrics is measured: without visible rock, or by the certificate alone, not all are."""
    of_rock, of_certificate = group in OF_VISIBLE_ROCK, group in _OF_CERTIFICATE
    return (params.overlay != "none" or not of_rock) and (params.extent == "full" or of_certificate)


def is_rock_judged(params: ValidationParams, figures: Mapping[str, Any]) -> bool:
    """Return whether a mine has drifts for one whole draw of stretches of rock, by its flat figures.

    The limits on texture and relief are those of such draws. In a shorter mine both are measured and not judged: a
    single block decides about them.
    """
    drift_m = figures.get("topology.drift_m")
    return drift_m is None or drift_m >= params.texture.draw_m


def applying_limits(params: ValidationParams, figures: Mapping[str, Any]) -> dict[str, Limit]:
    """Return the limits on the groups of metrics that are measured and judged, by the mine's flat figures."""
    not_judged = () if is_rock_judged(params, figures) else _OF_ROCK
    of_group = {name: name.partition(".")[0] for name in params.limits}
    judged = {group for group in of_group.values() if is_measured(group, params) and group not in not_judged}
    return {name: limit for name, limit in params.limits.items() if of_group[name] in judged}
