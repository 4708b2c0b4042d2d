"""Parsers of numbers on the command line."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

from minesurveys.guard.plain_number import plain_number


def number(text: str) -> float:
    """Return a number of ASCII digits, as in the files that are read."""
    try:
        return plain_number(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _whole(text: str) -> int:
    """Return an integer of ASCII digits."""
    value = number(text)
    if not value.is_integer():
        raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number")
    return int(value)


def ratio(text: str) -> float:
    """Return N of a scale, from 1:N or N."""
    one, _, many = text.rpartition(":")
    if one.strip() not in ("", "1"):
        raise argparse.ArgumentTypeError(f"{text!r}: expected 1:N, for example 1:2500")
    return number(many)


def positive(text: str) -> int:
    """Return an integer of 1 or more."""
    value = _whole(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value}: expected 1 or more")
    return value


def natural(text: str) -> int:
    """Return an integer of 0 or more."""
    value = _whole(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{value}: expected 0 or more")
    return value


def numbers(*counts: int) -> Callable[[str], list[float]]:
    """Return a parser of finite numbers separated by commas, as many as one of `counts`."""

    def parse(text: str) -> list[float]:
        values = [number(part) for part in text.split(",")]
        if len(values) not in counts or not all(map(math.isfinite, values)):
            wanted = " or ".join(map(str, counts))
            raise argparse.ArgumentTypeError(f"{text!r}: expected {wanted} finite numbers separated by commas")
        return values

    return parse


def elevation(text: str) -> tuple[str, float]:
    """Return a layer and its elevation, m, from LAYER=M."""
    layer, _, value = text.rpartition("=")
    if not layer or not math.isfinite(number(value)):
        raise argparse.ArgumentTypeError(f"{text!r}: expected LAYER=M")
    return layer, number(value)


def piece(text: str) -> str | list[float]:
    """Return a place of three numbers E,N,Z, or else a station's name."""
    try:
        return numbers(3)(text)
    except (ValueError, argparse.ArgumentTypeError):
        return text


def grade(text: str) -> float | dict[str, float]:
    """Return a rise over run, or one for each leg of LEG=G,LEG=G; a name may have other equals signs."""
    if "=" not in text:
        return number(text)
    found: dict[str, float] = {}
    for part in text.split(","):
        leg, _, value = (piece.strip() for piece in part.rpartition("="))
        if not leg or leg in found:
            raise argparse.ArgumentTypeError(f"{part!r}: expected LEG=G with each leg once, separated by commas")
        found[leg] = number(value)
    if not all(map(math.isfinite, found.values())):
        raise argparse.ArgumentTypeError(f"{text!r}: expected finite numbers")
    return found


def columns(text: str) -> dict[str, str]:
    """Return the table's name of each of our columns, from OURS=NAME,OURS=NAME; a name may have blanks."""
    found: dict[str, str] = {}
    for part in text.split(","):
        ours, _, name = (piece.strip() for piece in part.partition("="))
        if not ours or not name or ours in found:
            raise argparse.ArgumentTypeError(f"{part!r}: expected OURS=NAME with each column once, separated by commas")
        found[ours] = name
    return found


def whole_numbers(count: int) -> Callable[[str], list[int]]:
    """Return a parser of `count` integers of 0 or more separated by commas."""

    def parse(text: str) -> list[int]:
        values = [_whole(part) for part in text.split(",")]
        if len(values) != count or min(values) < 0:
            raise argparse.ArgumentTypeError(f"{text!r}: expected {count} whole numbers of 0 or more, with commas")
        return values

    return parse
