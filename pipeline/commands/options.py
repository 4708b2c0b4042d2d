"""The options of `new` on the command line, made from the fields of `StatedOptions`."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from types import NoneType
from typing import Any, Literal, get_args, get_origin

from pipeline.commands.arguments import (
    columns,
    elevation,
    grade,
    number,
    numbers,
    piece,
    positive,
    ratio,
    whole_numbers,
)
from pipeline.params.stated import BarBoxPx, Colour, Elevations, Ratio, SeedPx, StatedOptions, option, state
from pipeline.params.survey import BoxPx, Columns, Grade, PieceOption, StartM

_PARSERS: dict[Any, Callable[[str], Any]] = {  # type of a field, or of an item of its list -> parser of its text
    float: number,
    Ratio: ratio,
    int: positive,
    str: str,
    Path: Path,
    BoxPx: whole_numbers(4),
    BarBoxPx: numbers(4),
    SeedPx: numbers(2),
    Colour: whole_numbers(3),
    StartM: numbers(2, 3),
    Elevations: elevation,
    Grade: grade,
    Columns: columns,
    PieceOption: piece,
}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add an option for each field of `StatedOptions`."""
    for name, field in StatedOptions.model_fields.items():
        typed, kind = option(name), _type_of(name)
        reading: dict[str, Any] = {"action": "store_const", "const": True} if kind is bool else _reading(kind)
        if kind is not bool:
            reading["metavar"] = typed.metavar
        parser.add_argument(*typed.flags, dest=name, help=field.description, **reading)


def stated_options(source: Path, typed: argparse.Namespace) -> StatedOptions:
    """Return the options of a parsed command line.

    Raises
    ------
    InputError
        If a value is out of range; the message names `source` and the option.
    """
    values = {name: getattr(typed, name) for name in StatedOptions.model_fields}
    pairs = {name: dict(values[name]) for name in values if values[name] and _type_of(name) is Elevations}
    return state(source, values | pairs)


def _type_of(name: str) -> Any:
    """Return a field's type without None."""
    return next(kind for kind in get_args(StatedOptions.model_fields[name].annotation) if kind is not NoneType)


def _reading(kind: Any) -> dict[str, Any]:
    """Return what argparse needs to read a value of a type; lists and tables repeat the option."""
    if get_origin(kind) is Literal:
        return {"choices": get_args(kind)}
    if get_origin(kind) is list:
        return {"type": _PARSERS[get_args(kind)[0]], "action": "append"}
    return {"type": _PARSERS[kind], **({"action": "append"} if kind is Elevations else {})}
