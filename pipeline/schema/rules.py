"""Rules for one value: which texts or JSON values a field accepts, and how an error states that."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

_NUMBERS = re.compile(r"[-+.0-9e ]+")  # what both Python and MuJoCo read alike, once each token is a number


@dataclass(frozen=True)
class Rule:
    """What a value must be: a test, and the end of the sentence `want ...`."""

    accepts: Callable[[Any], bool]
    wants: str


def numbers_in(text: str) -> list[float] | None:
    """Return the numbers of a text as MuJoCo writes them, one space apart; None if it is anything else."""
    if not _NUMBERS.fullmatch(text):
        return None
    try:
        values = list(map(float, text.split(" ")))
    except ValueError:
        return None
    return None if math.inf in values or -math.inf in values else values


def matching(pattern: str, wants: str) -> Rule:
    """Accept a text that matches a pattern as a whole."""
    compiled = re.compile(pattern, re.ASCII)
    return Rule(lambda text: isinstance(text, str) and bool(compiled.fullmatch(text)), wants)


def is_number(value: Any) -> bool:
    """Return whether a JSON value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def number(low: float, high: float) -> Rule:
    """Accept a number from low to high."""
    return Rule(lambda value: is_number(value) and low <= value <= high, f"a number from {low:g} to {high:g}")


def whole(low: int, high: int) -> Rule:
    """Accept an integer from low to high."""
    return Rule(
        lambda value: isinstance(value, int) and not isinstance(value, bool) and low <= value <= high,
        f"a whole number from {low} to {high}",
    )


def list_of(rule: Rule, count: int) -> Rule:
    """Accept a list of so many values."""
    return Rule(
        lambda value: isinstance(value, list) and len(value) == count and all(map(rule.accepts, value)),
        f"a list of {count}, each {rule.wants}",
    )


def one_of_texts(*texts: str) -> Rule:
    """Accept one of these texts, and no other kind of value."""
    return Rule(lambda value: isinstance(value, str) and value in texts, " or ".join(map(repr, texts)))


def same_json(wanted: Any) -> Rule:
    """Accept this value only."""
    return Rule(lambda value: type(value) is type(wanted) and value == wanted, repr(wanted))
