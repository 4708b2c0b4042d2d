"""Comparison of metrics with their limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.errors import LimitError
from pipeline.params.validation import Limit


def flatten(metrics: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested metrics as one flat dict, with names joined by dots."""
    flat: dict[str, Any] = {}
    for key, value in metrics.items():
        flat |= flatten(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return flat


def is_time(name: str) -> bool:
    """Return whether a metric is a time, which depends on the machine and its load: it never fails a world."""
    return name.endswith("_s")


def breaches(metrics: Mapping[str, Any], limits: Mapping[str, Limit]) -> list[str]:
    """Return one line for each metric that breaches its limit: name, value, limit, and where that is known, the place.

    The place of `a.b_mm` is `a.b_at`.
    """
    flat = flatten(metrics)
    lines = []
    for name, limit in limits.items():
        value = flat.get(name)
        if name in flat and value is None:
            lines.append(f"{name}: there is no figure (limit {format_limit(limit)})")
        elif not isinstance(value, int | float):
            lines.append(f"{name}: not measured (limit {format_limit(limit)})")
        elif not limit.holds(value):
            at = flat.get(f"{name.rpartition('_')[0]}_at")
            lines.append(f"{name} = {value:.6g}: limit {format_limit(limit)}{'' if at is None else f', {at}'}")
    return lines


def require_limits(metrics: Mapping[str, Any], limits: Mapping[str, Limit]) -> None:
    """Raise `LimitError` with all breaches if there is any."""
    lines = breaches(metrics, limits)
    if lines:
        raise LimitError("\n  ".join([f"{len(lines)} of {len(limits)} limits breached (conf/validation)", *lines]))


def format_limit(limit: Limit) -> str:
    """Return a limit as `>= 0.99`, `<= 1`, or both."""
    return " and ".join(
        f"{sign} {value:g}" for sign, value in ((">=", limit.min), ("<=", limit.max)) if value is not None
    )
