"""What the numbers of a task or a robot may be."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Span:
    """Numbers from `low` to `high`, both included; with `whole`, whole ones only."""

    low: float
    high: float
    whole: bool = False

    def accepts(self, value: Any) -> bool:
        """Return whether a value is a number within the span; NaN and truth values are none."""
        kind = numbers.Integral if self.whole else numbers.Real
        return isinstance(value, kind) and not isinstance(value, bool) and self.low <= value <= self.high  # type: ignore[operator]

    def __str__(self) -> str:
        """Return what is accepted, as a sentence's part."""
        number = "a whole number" if self.whole else "a number"
        most = "" if math.isinf(self.high) else f" to {self.high:,.10g}"
        return f"{number} from {self.low:,.10g}{most}{' or more' if not most else ''}"


def check_numbers(kind: str, params: Any, spans: Mapping[str, Span]) -> None:
    """Refuse a field of `params` that lies outside its span.

    Raises
    ------
    ValueError
        Naming the kind of parameters, the field, its value, and what is accepted.
    """
    for name, span in spans.items():
        value = getattr(params, name)
        if not span.accepts(value):
            raise ValueError(f"{kind}: {name} = {value!r:.100}: want {span}")
