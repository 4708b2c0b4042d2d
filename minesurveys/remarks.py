"""Remarks: what was guessed, dropped or assumed, with its count or value and the option that overrules it."""

from __future__ import annotations

import string
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

from minesurveys.errors import printable

_MOST_REMARKS = 100  # of one collection: a hostile file may cause any number
_MOST_CHARACTERS = 600
_NO_FIGURES = str.maketrans("", "", string.digits + ",.")
_sinks: list[list[Remark]] = []  # collections that are open, the innermost last
_printed: set[Remark] = set()


@dataclass(frozen=True)
class Remark:
    """One fact.

    Attributes
    ----------
    what : str
    value : str
        How many, or the value that was taken: the first words of the sentence that `what` goes on with.
    option : str
        The options of `new` and parameters that overrule it.
    of : str
        The file or the stage that it is about.
    advice : str
        What an option does, at the end of a line.
    """

    what: str
    value: str = ""
    option: str = ""
    of: str = ""
    advice: str = ""

    def line(self) -> str:
        """Return the remark as one printable line."""
        place, value = f"{self.of}: " if self.of else "", f"{self.value} " if self.value else ""
        is_named = all(option in self.what for option in self.option.split(", "))
        advice = self.advice or ("" if is_named else f"{self.option} overrules it")
        return printable(f"{place}{value}{self.what}{'; ' if advice else ''}{advice}", _MOST_CHARACTERS)

    def named_in(self, source: str) -> Remark:
        """Return the remark for a table about a file, whose name need not be repeated; that of another file stays."""
        is_other = "." in self.of and self.of != source
        return replace(self, what=f"{self.of}: {self.what}") if is_other else self


def warn_user(what: str, *, of: object = "", count: object = "", option: str = "", advice: str = "") -> None:
    """Warn the user of what was left out or assumed: print a line on standard error, or add it to what is collected.

    The arguments are those of `Remark`; `count` is its value. A process of `run_limited` hands its remarks to its
    parent.
    """
    _add(Remark(what, str(count), option, str(of), advice))


def _add(remark: Remark) -> None:
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
        kinds = {_kind_of(remark) for remark in remarks}
        _sinks[-1][:] = [r for r in _sinks[-1] if r in remarks or _kind_of(r) not in kinds]
    for remark in remarks:
        if _sinks or remark not in _printed:
            _add(remark)
    if not _sinks:
        _printed.update(remarks)


def _kind_of(remark: Remark) -> tuple[str, str]:
    """Return what remarks have in common that differ in their figures only."""
    return remark.of, remark.what.translate(_NO_FIGURES)


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
