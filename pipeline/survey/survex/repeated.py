"""Two readings of one leg in a row, of which the first is flagged duplicate and the second is not.

Survex averages readings in a row, and the leg has the flags of the first, so the passage would be lost:
findings/survex-repeated-leg-takes-first-flags.sh.
"""

from __future__ import annotations

import re

_FLAGS = re.compile(r"[ \t,]*\*[ \t,]*flags\b(.*)", re.IGNORECASE)
_NOT_DUPLICATE = re.compile(r"\bnot\s+duplicate\b", re.IGNORECASE)
_OTHER = re.compile(r"[ \t,]*\*")


def flagged_together(lines: list[str]) -> list[str]:
    """Return the lines of a Survex file with such a first reading after the line that takes its flag back."""
    found = list(lines)
    first: tuple[int, list[str]] | None = None  # the last reading: its line, and its stations
    ends_at = -1  # the line that took the flag back since then
    for number, line in enumerate(lines):
        words = line.partition(";")[0].replace(",", " ").split()
        flags = _FLAGS.match(line)
        if flags is not None and _NOT_DUPLICATE.search(flags[1].partition(";")[0]) and ends_at < 0:
            ends_at = number
        elif _OTHER.match(line):
            first, ends_at = None, -1
        elif words:
            stations = words[:2]  # readings from the other end are a leg of their own
            if first is not None and ends_at >= 0 and first[1] == stations and len(stations) == 2:
                found[first[0]], found[ends_at] = found[ends_at], found[first[0]]
            first, ends_at = (number, stations), -1
    return found
