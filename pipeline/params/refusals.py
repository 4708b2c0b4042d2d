"""What is wrong with a configuration, by the keys that its author wrote."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from minesurveys.refusals import in_own_words

_CHOSEN = ("survey", "collision", "grade")  # unions of several kinds: pydantic inserts the kind after their names
_REFERENCE = re.compile(r"\$\{(?:oc\.select:)?(\w+(?:\.\w+)+)(?:,.*)?\}")  # ${contours.tolerance_m}
_MOST_HOPS = 8  # realism.made_by refers to validation, which refers to contours
_MISSING = "???"  # Hydra's value that must be given


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
