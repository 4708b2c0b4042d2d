"""The groups of stage 6's metrics: which are measured of a world, and which limits apply to it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from pipeline.params.validation import Limit, ValidationParams

_OF_ROCK = ("texture", "relief")
_OF_PLAN = "iou"  # also of a volume that is a traced plan
OF_VISIBLE_ROCK = (*_OF_ROCK, "walls")
JUDGED_HEIGHT_M = 2.5  # of a volume's drifts: plumb walls then reach 1.5 m, the height of the upper cut
_OF_CERTIFICATE = ("areas", "collision", "survey", "certificate")
# of a cut to the wall in plan: in a volume that wall is not the border of the floor everywhere
_TO_PLAN = ".length_ratio"
# of a volume's rock: in 130 m of drift a slope has a s.d. of 0.43 and is 0.6 within its limit
_OF_SPECTRUM, _SPECTRUM_DRAWS = ".slope.", 5


def is_measured(group: str, params: ValidationParams) -> bool:
    """Return whether a group of metrics is measured: without visible rock, or by the certificate alone, not all are."""
    of_rock, of_certificate = group in OF_VISIBLE_ROCK, group in _OF_CERTIFICATE
    return (params.overlay != "none" or not of_rock) and (params.extent == "full" or of_certificate)


def why_rock_is_not_judged(params: ValidationParams, figures: Mapping[str, Any]) -> str | None:
    """Return why texture and relief of a mine's rock have no limits, by its flat figures; None if they have.

    The limits are those of one whole draw of stretches: in fewer drifts a single block decides. Points that are far
    apart, as those of a large mine are, cannot have the relief of short wavelengths. The surface of a solid that was
    read, and not drawn, is rock itself, and its own relief is in the figures.
    """
    drift_m, draw_m = figures.get("topology.drift_m"), params.texture.draw_m
    spacing_m, widest_m = figures.get("relief.spacing_m", 0.0), params.texture.widest_spacing_m
    if spacing_m > widest_m:
        return (
            f"points of the rock are {spacing_m:.2g} m apart, too far to judge texture and relief by ({widest_m:g} m)"
        )
    if "solid.iou" in figures and "drawn.floor_mm" not in figures:
        return "texture and relief are measured, not judged: the surface of the solid has its own relief"
    if drift_m is None or drift_m >= draw_m:
        return None
    high = f", {JUDGED_HEIGHT_M:g} m high or more," if is_volume(figures) else ""
    return f"{drift_m:g} m of drift{high} are too few to judge texture and relief of the rock by ({draw_m:g} m)"


def applying_limits(params: ValidationParams, figures: Mapping[str, Any]) -> dict[str, Limit]:
    """Return the limits on the groups of metrics that are measured and judged, by the mine's flat figures."""
    judged = () if why_rock_is_not_judged(params, figures) else _OF_ROCK
    if is_volume(figures):
        rock = judged if "texture.draws" in figures else ()
        plan = [_OF_PLAN] if any(name.startswith(f"{_OF_PLAN}.") for name in figures) else []
        return params.volume.applying(figures) | _of_groups(params, {*rock, *plan}, _left_out(params, figures))
    groups = {name.partition(".")[0] for name in params.limits}
    groups -= set() if "survey.narrowed_m" in figures else {"survey"}  # of plans and maps there are no legs
    measured = {g for g in groups if is_measured(g, params) and (g in judged or g not in _OF_ROCK)}
    return _of_groups(params, measured)


def _left_out(params: ValidationParams, figures: Mapping[str, Any]) -> list[str]:
    """Return parts of the names of figures that a volume's rock is not judged by."""
    is_short = figures.get("topology.drift_m", 0.0) < _SPECTRUM_DRAWS * params.texture.draw_m
    return [_TO_PLAN, _OF_SPECTRUM] if is_short else [_TO_PLAN]


def _of_groups(params: ValidationParams, groups: Collection[str], left_out: Collection[str] = ()) -> dict[str, Limit]:
    own = {name: limit for name, limit in params.limits.items() if name.partition(".")[0] in groups}
    return {name: limit for name, limit in own.items() if not any(part in name for part in left_out)}


def is_volume(figures: Mapping[str, Any]) -> bool:
    """Return whether flat figures are those of a world that is one volume."""
    return "volume.free_m3" in figures
