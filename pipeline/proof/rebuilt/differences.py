"""The first place where two JSON values differ."""

from __future__ import annotations

from typing import Any


def first_difference(found: Any, wanted: Any, margin: float, path: str = "") -> str | None:
    """Return the first path at which two values differ, with both values, or None if they agree.

    Numbers may differ by `margin`, integers and texts not at all.
    """
    if isinstance(found, dict) and isinstance(wanted, dict):
        for key in [*wanted, *(key for key in found if key not in wanted)]:
            if key not in found or key not in wanted:
                return f"{path}.{key} is {'missing' if key in wanted else 'unknown'}".lstrip(".")
            inner = first_difference(found[key], wanted[key], margin, f"{path}.{key}")
            if inner:
                return inner
        return None
    if isinstance(found, list | tuple) and isinstance(wanted, list | tuple):
        if len(found) != len(wanted):
            return f"{path} has {len(found)} entries, want {len(wanted)}".lstrip(".")
        pairs = enumerate(zip(found, wanted, strict=True))
        return next((d for i, (a, b) in pairs if (d := first_difference(a, b, margin, f"{path}[{i}]"))), None)
    if isinstance(found, float) or isinstance(wanted, float):
        numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in (found, wanted))
        same = numbers and abs(found - wanted) <= margin
    else:
        same = type(found) is type(wanted) and found == wanted
    return None if same else f"{path} = {str(found)[:60]}, want {str(wanted)[:60]}".lstrip(".")
