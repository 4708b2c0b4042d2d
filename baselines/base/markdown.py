"""Tables in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def markdown_table(titles: Iterable[object], rows: Iterable[Sequence[object]]) -> str:
    """Return a table that ends with a line break; cells are shown as `str` shows them."""
    head = list(titles)
    lines = [_line(head), "|---" * len(head) + "|", *map(_line, rows)]
    return "\n".join(lines) + "\n"


def _line(cells: Iterable[object]) -> str:
    return f"| {' | '.join(map(str, cells))} |"
