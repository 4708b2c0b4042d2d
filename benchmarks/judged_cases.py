"""Pages of evidence whose cases are judged one by one: a row a case, kept in a file, and a table of groups of rows."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from baselines.base.markdown import markdown_table, write_table
from benchmarks.results import Row
from pieces.results import PiecesError
from pieces.run import map_pieces
from pieces.work import Work, add_options, code_sha256, where_of

PAGES = Path("docs/evidence/parts")
_MEMORY_GB = 4.0  # of a case, the largest of all kinds
CODE = "EVIDENCE_CODE"  # the variable by which `python -m benchmarks` states the hash of a measurement's code
ALL = "all"


@dataclass(frozen=True)
class JudgedCases:
    """Cases of one kind, how each is judged, and how the page shows them.

    Attributes
    ----------
    name : str
        Of the measurement, its page and its file of results.
    cases : sequence
        All that can be judged.
    sample : int
        How many of them the page needs, the first ones; `--count` takes fewer or more. All without it.
    judge : callable
        Returns the row of a case; an error of the case is a row, too.
    holds : callable
        Whether a row has all that is wanted.
    groups : callable
        Returns the names of the table's lines that a row counts in.
    columns : dict
        Title of a column to what returns its cell, of the rows of a line.
    of : str
        Title of the first column.
    with_all : bool
        Whether a last line counts all rows.
    note : callable
        Returns text below the table, of all rows.
    has_page : bool
        Whether the table is written to a page; it is printed in any case.
    """

    name: str
    cases: Sequence[Any]
    judge: Callable[[Any], Row]
    holds: Callable[[Row], bool]
    groups: Callable[[Row], Iterable[str]]
    columns: dict[str, Callable[[list[Row]], object]]
    sample: int | None = None
    of: str = ""
    with_all: bool = True
    note: Callable[[list[Row]], str] = lambda rows: ""
    has_page: bool = True

    def table(self, rows: list[Row]) -> str:
        """Return the results as Markdown; lines stand in the order of their first row."""
        lines: dict[str, list[Row]] = {}
        for row in rows:
            for group in self.groups(row):
                lines.setdefault(group, []).append(row)
        if self.with_all:
            lines[ALL] = rows
        cells = ((group, *(cell(some) for cell in self.columns.values())) for group, some in lines.items())
        return "\n".join(filter(None, (markdown_table((self.of, *self.columns), cells), self.note(rows))))

    def run(self, about: str | None) -> int:
        """Judge the cases that have no row of this code yet, write the page; return exit code 2 if one does not hold.

        The page is written when the sample has a row each.
        """
        parser = argparse.ArgumentParser(prog=f"python -m benchmarks {self.name}", description=about)
        sample = len(self.cases) if self.sample is None else self.sample
        parser.add_argument("--count", type=int, default=sample, help=f"the first cases, of {len(self.cases)}")
        add_options(parser, 2)
        given = parser.parse_args()
        wanted = list(self.cases[: given.count])
        code = os.environ.get(CODE) or code_sha256(
            "minesurveys", "minexplore", "pipeline", "stages", "baselines", "benchmarks"
        )
        work = Work(self.name, _imported(self.judge), Row, code, memory_gb=_MEMORY_GB, label=_label_of)
        try:
            found = map_pieces(work, wanted, where_of(given))
        except PiecesError as error:
            print(f"{self.name}: {error}", file=sys.stderr)
            return 2
        rows = [{"case": case, **row} for case, row in zip(wanted, found, strict=True)]
        text = self.table(rows)
        if self.has_page and len(wanted) >= sample:
            write_table(PAGES / f"{self.name}.md", text)
        print(text)
        failed = [row for row in rows if not self.holds(row)]
        for row in failed:
            print(row)
        return 2 if failed else 0


def _imported(judge: Callable[[Any], Row]) -> Callable[[Any], Row]:
    """Return a function of the main module as that of a module that nodes import, with its caches."""
    main = sys.modules["__main__"].__spec__
    return resolve_name(f"{main.name}:{judge.__qualname__}") if main and judge.__module__ == "__main__" else judge


def _label_of(case: Any) -> str:
    return "-".join(map(str, case)) if isinstance(case, tuple) else str(case)


def largest(key: str, form: str = "g", factor: float = 1.0) -> Callable[[list[Row]], str]:
    """Return a column: the largest of a figure, times a factor, of the rows that have it."""
    return _extreme(max, key, form, factor)


def least(key: str, form: str = "g", factor: float = 1.0) -> Callable[[list[Row]], str]:
    """Return a column: the least of a figure, times a factor, of the rows that have it."""
    return _extreme(min, key, form, factor)


def span(key: str, form: str = "g") -> Callable[[list[Row]], str]:
    """Return a column: the least and the largest of a figure."""
    low, high = least(key, form), largest(key, form)
    return lambda rows: f"{low(rows)} to {high(rows)}" if low(rows) else ""


def _extreme(choose: Callable[..., float], key: str, form: str, factor: float) -> Callable[[list[Row]], str]:
    def cell(rows: list[Row]) -> str:
        values = [row[key] for row in rows if key in row]
        return format(factor * choose(values), form) if values else ""

    return cell
