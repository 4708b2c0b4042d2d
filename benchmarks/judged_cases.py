"""Pages of evidence whose cases are judged one by one: a row a case, kept in a file, and a table of groups of rows."""

from __future__ import annotations

import argparse
import multiprocessing
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from baselines.base.markdown import markdown_table, write_table
from benchmarks.resume import Row, resume

PAGES, RESULTS = Path("docs/evidence/parts"), Path("artifacts/bench")
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
        The sample; `--count` takes the first ones.
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
    """

    name: str
    cases: Sequence[Any]
    judge: Callable[[Any], Row]
    holds: Callable[[Row], bool]
    groups: Callable[[Row], Iterable[str]]
    columns: dict[str, Callable[[list[Row]], object]]
    of: str = ""
    with_all: bool = True
    note: Callable[[list[Row]], str] = lambda rows: ""

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

        The page is written when all cases of the sample have a row.
        """
        parser = argparse.ArgumentParser(prog=f"python -m benchmarks {self.name}", description=about)
        parser.add_argument("--count", type=int, default=len(self.cases), help="the first cases of the sample only")
        parser.add_argument("--jobs", type=int, default=2, help="cases at a time")
        given = parser.parse_args()
        wanted, code = list(self.cases[: given.count]), os.environ.get(CODE, "")

        def judged(cases: list[Any]) -> Iterable[Row]:
            return ({**row, "code": code} for row in _in_processes(self.judge, cases, given.jobs))

        def is_valid(row: Row) -> bool:
            return row.get("code") == code

        kept = resume(RESULTS / f"{self.name}.jsonl", wanted, judged, "case", _case_of, is_valid)
        rows = sorted((row for row in kept if _case_of(row) in wanted), key=lambda row: wanted.index(_case_of(row)))
        text = self.table(rows)
        if len(wanted) == len(self.cases):
            write_table(PAGES / f"{self.name}.md", text)
        print(text)
        failed = [row for row in rows if not self.holds(row)]
        for row in failed:
            print(row)
        return 2 if failed else 0


def _case_of(row: Row) -> Any:
    """Return a row's case; JSON has lists for tuples."""
    return tuple(row["case"]) if isinstance(row["case"], list) else row["case"]


def _in_processes(judge: Callable[[Any], Row], cases: list[Any], jobs: int) -> Iterable[Row]:
    """Yield the rows of cases, with the case, as they are done; one job runs in this process."""
    if jobs < 2 or len(cases) < 2:
        yield from ({"case": case, **judge(case)} for case in cases)
        return
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        waiting = {pool.submit(judge, case): case for case in cases}
        yield from ({"case": waiting[done], **done.result()} for done in as_completed(waiting))


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
