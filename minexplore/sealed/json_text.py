"""Read the JSON of a bundle: size, nesting, keys and numbers are judged before anything uses a value."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from minexplore.bundle import BundleError
from minexplore.limits import UnreadableError, require_small_json

MOST_BYTES = 64 << 20
_MOST_CHARACTERS = 25  # of a number; the longest that Python writes of 64 bits has 24
_DEEPEST = 16  # a plan of several polygons has 8 levels
_MOST_SHOWN = 40  # characters of a key or a number in a message
_MOST_VALUES = 16_000_000  # twice what 2.5 million corners take


@dataclass(frozen=True)
class _Refused:
    """Stands in the content for a value that is refused; `fault` ends the sentence `FIELD ...`."""

    fault: str


def describe_json_error(error: Exception) -> str:
    """Return what is wrong with a text that is no JSON, and where, for a message: `not JSON from line 2 ... on`."""
    if isinstance(error, json.JSONDecodeError):
        return f"not JSON from line {error.lineno}, character {error.colno} on"
    if isinstance(error, UnicodeDecodeError):
        return f"not UTF-8 text from byte {error.start} on"
    return "not JSON, its values are nested too deep" if isinstance(error, RecursionError) else "not JSON"


def read_json(file: str, data: bytes, most_bytes: int = MOST_BYTES, most_values: int = _MOST_VALUES) -> Any:
    """Return the content of a JSON file.

    Parameters
    ----------
    file : str
        For the message.
    data : bytes
    most_bytes, most_values : int

    Raises
    ------
    BundleError
        If it is too large or too deep, of too many values, or no JSON, or a key stands twice, or a number is not
        finite or longer than 25 characters. The message names the file, the field and its value.
    """
    if len(data) > most_bytes:
        raise BundleError(f"{file}: {len(data)} bytes, at most {most_bytes} are read")
    try:
        require_small_json(data, most_values, most_values, _DEEPEST)
    except UnreadableError as error:
        raise BundleError(f"{file}: not JSON of a world ({error})") from error
    refused: list[_Refused] = []

    def refuse(fault: str) -> _Refused:
        refused.append(_Refused(fault))
        return refused[-1]

    def read(kind: Callable[[str], float]) -> Callable[[str], Any]:
        def number(text: str) -> Any:
            if len(text) <= _MOST_CHARACTERS and math.isfinite(value := kind(text)):
                return value
            return refuse(f"= {text[:_MOST_SHOWN]}: want a finite number of at most {_MOST_CHARACTERS} characters")

        return number

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        fields = dict(pairs)
        if len(fields) != len(pairs):
            times = Counter(name for name, _ in pairs)
            fields |= {name: refuse("stands twice") for name in fields if times[name] > 1}
        return fields

    try:
        content = json.loads(
            data.decode("utf-8"),
            object_pairs_hook=once,
            parse_int=read(int),
            parse_float=read(float),
            parse_constant=lambda text: refuse(f"= {text}: want a finite number"),
        )
    except (ValueError, RecursionError) as error:
        raise BundleError(f"{file}: {describe_json_error(error)}") from error
    for where, fault in _faults(content) if refused else ():
        raise BundleError(f"{file}: {where or 'its content'} {fault}")
    return content


def _faults(value: Any, where: str = "") -> Iterator[tuple[str, str]]:
    """Yield the path and the fault of each value that is refused."""
    if isinstance(value, _Refused):
        yield where, value.fault
    elif isinstance(value, dict):
        for name, inner in value.items():
            yield from _faults(inner, f"{where}.{name[:_MOST_SHOWN]}".lstrip("."))
    elif isinstance(value, list):
        for number, inner in enumerate(value):
            yield from _faults(inner, f"{where}[{number}]")
