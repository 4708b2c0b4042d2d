"""Rounding of figures to the digits that are equal on every machine."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

# BLAS kernels and SIMD widths order sums differently. The texture report of the default world, made with AVX-512, with
# AVX2 and with SSE kernels, with one thread and with two, agrees to a relative 3.3e-13 or better; nine digits leave
# a margin of three orders of magnitude, so that two machines rarely round one figure differently.
DIGITS = 9

T = TypeVar("T")


def repeatable(value: T) -> T:
    """Round every float in a value to nine significant digits; dataclasses, dicts, lists and tuples are searched."""
    return _rounded(value)


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, list | tuple):
        return type(value)(_rounded(v) for v in value)
    if isinstance(value, dict):
        return {k: _rounded(v) for k, v in value.items()}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return dataclasses.replace(
            value, **{f.name: _rounded(getattr(value, f.name)) for f in dataclasses.fields(value)}
        )
    return value
