"""Tables in Markdown, and the pages that hold them: text that people write, and between two marks what code writes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from baselines.base.errors import BaselineError
from baselines.base.result_file import replace_text

BEGIN, END = "<!-- table -->", "<!-- end of the table -->"


def markdown_table(titles: Iterable[object], rows: Iterable[Sequence[object]]) -> str:
    """Return a table that ends with a line break; cells are shown as `str` shows them."""
    head = list(titles)
    lines = [_line(head), "|---" * len(head) + "|", *map(_line, rows)]
    return "\n".join(lines) + "\n"


def _line(cells: Iterable[object]) -> str:
    return f"| {' | '.join(map(str, cells))} |"


def with_table(page: str, table: str) -> str:
    """Return a page with other tables between its marks.

    Raises
    ------
    BaselineError
        If the page has no marks.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise BaselineError(f"a page needs the marks {BEGIN} and {END}")
    return f"{before}{begin}\n\n{table.strip()}\n\n{end}{after}"


def write_table(path: Path, table: str) -> None:
    """Write tables between the marks of a page; a new page holds nothing else.

    Raises
    ------
    BaselineError
        If the page has no marks.
    """
    page = path.read_text() if path.is_file() else f"{BEGIN}\n{END}\n"
    try:
        replace_text(path, with_table(page, table))
    except BaselineError as error:
        raise BaselineError(f"{path}: {error}") from error
