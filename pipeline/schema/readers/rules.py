"""Rules for one value: which texts or JSON values a field accepts, and how an error states that."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

_NUMBERS = re.compile(r"[-+.0-9e ]+")  # what both Python and MuJoCo read alike, once each token is a number
_WRITTEN = 1e-12  # relative: a model's text has 16 digits
_CONSTANT = 1e-7  # relative: constants have few digits, some went through 32 bits
_NOTHING = 1e-12  # what a zero may become


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


def same(one: float, two: float) -> bool:
    """Return whether two numbers are equal to the digits that a file of a world holds."""
    return abs(one - two) <= max(_NOTHING, _WRITTEN * max(abs(one), abs(two)))


def exactly(*texts: str) -> Rule:
    """Accept one of these texts."""
    return Rule(lambda text: text in texts, " or ".join(map(repr, texts)))


def matching(pattern: str, wants: str) -> Rule:
    """Accept a text that matches a pattern as a whole."""
    compiled = re.compile(pattern, re.ASCII)
    return Rule(lambda text: isinstance(text, str) and bool(compiled.fullmatch(text)), wants)


def equal_numbers(*wanted: float) -> Rule:
    """Accept exactly these numbers."""

    def accepts(text: str) -> bool:
        found = numbers_in(text)
        return (
            found is not None
            and len(found) == len(wanted)
            and all(abs(one - two) <= _CONSTANT * max(abs(two), 1e-3) for one, two in zip(found, wanted, strict=True))
        )

    return Rule(accepts, " ".join(f"{value:g}" for value in wanted))


def one_of(*rules: Rule) -> Rule:
    """Accept what one of these rules accepts."""
    return Rule(lambda text: any(rule.accepts(text) for rule in rules), " or ".join(rule.wants for rule in rules))


def numbers(count: int, low: float, high: float) -> Rule:
    """Accept so many numbers from low to high."""

    def accepts(text: str) -> bool:
        found = numbers_in(text)
        return found is not None and len(found) == count and all(low <= value <= high for value in found)

    return Rule(accepts, f"{count} number{'s' if count > 1 else ''} from {low:g} to {high:g}")


def unit_vector(count: int) -> Rule:
    """Accept so many numbers of length one."""

    def accepts(text: str) -> bool:
        found = numbers_in(text)
        return found is not None and len(found) == count and abs(math.hypot(*found) - 1) < 1e-4

    return Rule(accepts, f"{count} numbers of length 1")


def points(least: int, most: int, reach: float, axes: int = 3) -> Rule:
    """Accept the coordinates of several points, so many a point."""

    def accepts(text: str) -> bool:
        found = numbers_in(text)
        return (
            found is not None
            and len(found) % axes == 0
            and least <= len(found) // axes <= most
            and -reach <= min(found) <= max(found) <= reach
        )

    return Rule(accepts, f"{least} to {most} points of {axes} coordinates up to {reach:g} m")


# --- values of JSON ---------------------------------------------------------------------------------------------------


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
