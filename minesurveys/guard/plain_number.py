"""The numbers of text files: ASCII digits with a point and an exponent, as surveying programs write them."""

from __future__ import annotations

import re

# Python also takes 4_0, the digits of all scripts, and no-break spaces.
_NUMBER = re.compile(r"[-+]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|nan|inf(?:inity)?)", re.IGNORECASE)
_BLANKS = " \t\r\n"


def plain_number(text: str) -> float:
    """Return the number that a text states; `nan` and `inf` are numbers, which callers judge.

    Raises
    ------
    ValueError
        If the text is anything but one number between blanks.
    """
    stated = text.strip(_BLANKS)
    if not (stated.isascii() and _NUMBER.fullmatch(stated)):
        raise ValueError(f"{text[:40]!r} is not a number")
    return float(stated)
