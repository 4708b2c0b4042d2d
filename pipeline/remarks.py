"""Remarks: what was guessed, dropped or assumed, with its count or value and the option that overrules it."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from pipeline.errors import printable

_MOST_REMARKS = 100  # of one collection: a hostile file may cause any number
_MOST_CHARACTERS = 600
_NAMED = r"--[a-z][a-z-]*[a-z]|(?:survey|contours|compile3d|surface|realism)\.[a-z]\w*(?:\.[a-z]\w*)*(?:=\w+)?"
_OPTION = rf"(?<![\w.])(?:{_NAMED})"  # a station's name may end like one
_SOURCE = re.compile(r"(?:[^:\s][^:]*\.\w{1,8}|contours|compile3d|surface|realism|validation): ")
_COUNT = re.compile(r"(\d[\d,]*(?:\.\d+)?(?: (?:m2|m|%))?(?: of (?:its )?\d[\d,]*)?) (?=[^\d\s])")
_ADVICE = re.compile(rf"(?:; |, )(?:{_OPTION})(?: \(\S+\))?(?: \S+){{1,3}}$")  # of an option and what it does
_sinks: list[list[Remark]] = []  # collections that are open, the innermost last
_printed: set[Remark] = set()


@dataclass(frozen=True)
class Remark:
    """One fact: `what` of which `value` (a count, or the value that was taken), and the `option` that overrules it.

    A sentence alone is a remark, too: `split` finds its count and the options that it names.
    """

    what: str
    value: str = ""
    option: str = ""

    def line(self) -> str:
        """Return the remark as one printable line."""
        value = f": {self.value}" if self.value else ""
        option = f"; {self.option} overrules it" if self.option else ""
        return printable(f"{self.what}{value}{option}", _MOST_CHARACTERS)

    def split(self, source: str) -> Remark:
        """Return the remark with its count and its options in their places, as a sentence alone may hold them.

        `source` is the file whose name need not be repeated; the name of another file stays.
        """
        start = _SOURCE.match(self.what)
        place = start.group() if start else ""
        what = self.what[len(place) :]
        option = self.option or ", ".join(options_of(what))
        what = what if self.option else _ADVICE.sub("", what)
        count = None if self.value else _COUNT.match(what)
        if count is not None:
            what = what[count.end() :]
        is_other = "." in place and place != f"{source}: "
        return Remark(f"{place}{what}" if is_other else what, self.value or (count.group(1) if count else ""), option)


def options_of(text: str) -> list[str]:
    """Return the options of `new` and the parameters that a text names, each once."""
    return list(dict.fromkeys(re.findall(_OPTION, text)))


def warn_user(remark: Remark | str) -> None:
    """Warn the user of what was left out or assumed: print a line on standard error, or add it to what is collected.

    A process of `run_limited` hands its remarks to its parent.
    """
    remark = Remark(remark) if isinstance(remark, str) else remark
    if not _sinks:
        print(remark.line(), file=sys.stderr)
    elif remark not in _sinks[-1] and len(_sinks[-1]) < _MOST_REMARKS:
        _sinks[-1].append(remark)


def hand_on(remarks: list[Remark]) -> None:
    """Warn the user of what a process of `run_limited` remarked.

    A file is read at least twice, to detect it and in stage 1. A line is printed once. Of collected remarks that differ
    in their figures only, those of the last reading are kept: detection may try several units.
    """
    if _sinks:
        kinds = {_without_figures(remark) for remark in remarks}
        _sinks[-1][:] = [r for r in _sinks[-1] if r in remarks or _without_figures(r) not in kinds]
    for remark in remarks:
        if _sinks or remark not in _printed:
            warn_user(remark)
    if not _sinks:
        _printed.update(remarks)


def _without_figures(remark: Remark) -> str:
    return re.sub(r"\d[\d,.]*", "#", remark.what)


@contextmanager
def collect_remarks() -> Iterator[list[Remark]]:
    """Collect remarks into a list, each once, in place of lines on standard error."""
    found: list[Remark] = []
    _sinks.append(found)
    try:
        yield found
    finally:
        _sinks.pop()


@contextmanager
def record_remarks() -> Iterator[list[Remark]]:
    """Collect remarks into a list, and hand them on to the user at the end, also after an error."""
    found: list[Remark] = []
    try:
        with collect_remarks() as found:
            yield found
    finally:
        hand_on(found)
