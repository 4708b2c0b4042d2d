"""What is wrong with a value, in our own words, for files and settings that pydantic checks."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

from baselines.base.errors import BaselineError

T = TypeVar("T")

_MOST_SHOWN = 80  # characters of a value
_OURS = (  # pydantic's words, and ours
    ("Value error, ", ""),
    ("Input should be a valid number, unable to parse string as a number", "want a number"),
    ("Input should be a valid integer, unable to parse string as an integer", "want a whole number"),
    ("Input should be a valid integer, got a number with a fractional part", "want a whole number"),
    ("Input should be a valid boolean, unable to interpret input", "want true or false"),
    ("Input should be a valid integer", "want a whole number"),
    ("Input should be a valid string", "want a text"),
    ("Input should be a valid ", "want a "),
    ("Input should be ", "want "),
    ("Extra inputs are not permitted", "no such key"),
    ("Field required", "is missing"),
)


def first_refusal(error: ValidationError) -> str:
    """Return the first value that is refused, and why: `robots.count = 0: want greater than 0`."""
    first = error.errors(include_url=False)[0]
    problem = first["msg"]
    for theirs, ours in _OURS:
        problem = problem.replace(theirs, ours)
    place = ".".join(map(str, first["loc"]))
    if first["type"] == "json_invalid":
        return "not JSON"
    if first["type"] == "model_type":
        return f"{place} is a section of keys"
    if first["type"] == "missing":
        return f"{place} is missing"
    shown = repr(first["input"])[:_MOST_SHOWN]
    return f"{place} = {shown}: {problem}" if place else f"{shown}: {problem}"


def read_kept(path: Path, kind: TypeAdapter[T], empty: T, wanted: str) -> T:
    """Return what a JSON file keeps; `empty` without the file.

    Raises
    ------
    BaselineError
        If the file cannot be read, or holds something else than is `wanted`.
    """
    if not path.is_file():
        return empty
    try:
        return kind.validate_json(path.read_bytes())
    except ValidationError as error:
        raise BaselineError(f"{path}: no {wanted} ({first_refusal(error)})") from error
    except OSError as error:
        raise BaselineError(f"{path}: cannot be read ({error.strerror})") from error
