"""What is wrong with a configuration, by the keys that its author wrote."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

_CHOSEN = ("survey", "collision", "grade")  # unions of several kinds: pydantic inserts the kind after their names
_REFERENCE = re.compile(r"\$\{(?:oc\.select:)?(\w+(?:\.\w+)+)(?:,.*)?\}")  # ${contours.tolerance_m}
_MOST_HOPS = 8  # realism.made_by refers to validation, which refers to contours
_MISSING = "???"  # Hydra's value that must be given
_WORDS = {  # of pydantic's kinds of error; the names in braces are of its context
    "greater_than": "want more than {gt}",
    "greater_than_equal": "want at least {ge}",
    "less_than": "want less than {lt}",
    "less_than_equal": "want at most {le}",
    "finite_number": "want a finite number",
    "float_type": "want a number",
    "float_parsing": "want a number",
    "int_type": "want a whole number",
    "int_parsing": "want a whole number",
    "int_from_float": "want a whole number",
    "bool_type": "want true or false",
    "bool_parsing": "want true or false",
    "string_type": "want a text",
    "string_too_short": "want at least {min_length} characters",
    "string_too_long": "want at most {max_length} characters",
    "string_pattern_mismatch": "want a text of the form {pattern}",
    "literal_error": "want {expected}",
    "enum": "want {expected}",
    "too_short": "want {min_length} or more, got {actual_length}",
    "too_long": "want at most {max_length} items",
    "list_type": "want a list",
    "tuple_type": "want a list",
    "dict_type": "want a section of keys",
    "model_type": "want a section of keys",
    "model_attributes_type": "want a section of keys",
    "missing": "is missing",
    "none_required": "want null",
    "extra_forbidden": "no such key",
    "json_invalid": "not JSON",
}


def describe_refusals(error: ValidationError, written: dict[str, Any]) -> str:
    """Return one line for each refused key: `section.key = value: what is wrong`.

    Parameters
    ----------
    error : pydantic.ValidationError
        Of the whole configuration.
    written : dict
        The configuration with its references (`${contours.tolerance_m}`) as they are written. A value that refers to
        another key is named by that key.
    """
    lines: dict[str, str] = {}
    for one in error.errors():
        key, line = _describe(one, written)
        lines.setdefault(key, line)
    return "\n".join(lines.values())


def in_own_words(error: ErrorDetails) -> str:
    """Return what is wrong with a value that pydantic refuses, in the words of this project."""
    words = _WORDS.get(error["type"])
    if words is not None:
        return words.format(**error.get("ctx", {}))
    return error["msg"].removeprefix("Value error, ").replace("Input should be", "want")


def first_refusal(error: ValidationError) -> str:
    """Return the first key that is refused and what is wrong with its value, of a file of its own."""
    first = error.errors()[0]
    place = ".".join(map(str, first["loc"]))
    return f"{place}: {in_own_words(first)}" if place else in_own_words(first)


def _describe(error: ErrorDetails, written: dict[str, Any]) -> tuple[str, str]:
    """Return the key of one refused value, and its line."""
    place, value, problem = list(error["loc"]), error["input"], in_own_words(error)
    place = [part for i, part in enumerate(place) if not i or place[i - 1] not in _CHOSEN]
    tag = str(error.get("ctx", {}).get("discriminator", "")).strip("'")
    if error["type"] == "union_tag_invalid" and tag.isidentifier():
        place, value = [*place, tag], error["ctx"]["tag"]
        problem = f"valid choices are {error['ctx']['expected_tags']}"
    key = ".".join(map(str, _origin(place, written)))
    if value == _MISSING:
        return key, f"{key}: has no value; state one"
    shown = f" = {value!r}" if key and not isinstance(value, dict) else ""
    return key, f"{key}{shown}: {problem}" if key else problem


def _origin(place: Sequence[str | int], written: Any, hops: int = _MOST_HOPS) -> list[str | int]:
    """Return the place of the key that a value at `place` refers to, also over other keys, else `place`."""
    node = written
    for depth, part in enumerate(place):
        try:
            node = node[part]
        except (KeyError, IndexError, TypeError):
            break
        reference = _REFERENCE.fullmatch(node) if isinstance(node, str) else None
        if reference and hops:
            return _origin([*reference[1].split("."), *place[depth + 1 :]], written, hops - 1)
    return list(place)
