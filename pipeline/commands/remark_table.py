"""The table of remarks that `new` prints: how many, what, and the option that overrules it."""

from __future__ import annotations

import shutil
import textwrap
from itertools import zip_longest

from minesurveys.errors import printable
from minesurveys.remarks import Remark

_HEAD = Remark("what", "how many", "overruled by")
_VALUE, _OPTION = 16, 32  # characters of these columns at most
_NARROW = 80  # characters of a line at least


def remark_table(source: str, remarks: list[Remark], width: int | None = None) -> str:
    """Return remarks as a table with wrapped cells.

    Parameters
    ----------
    source : str
        The file's name, the heading.
    remarks : list of Remark
    width : int, optional
        Characters of a line; default: the terminal's, at least 80.
    """
    wanted = width or max(shutil.get_terminal_size((110, 24)).columns, _NARROW)
    rows = [_printable(remark.named_in(source)) for remark in remarks]
    first = min(_VALUE, max(len(row.value) for row in (_HEAD, *rows)))
    last = min(_OPTION, max(len(row.option) for row in (_HEAD, *rows)))
    widths = first, wanted - first - last - 6, last
    body = [line for row in rows for line in _lines(row, widths)]
    return "\n".join([f"{source}: guessed, dropped or assumed", *_lines(_HEAD, widths), *body])


def _printable(row: Remark) -> Remark:
    return Remark(*(printable(text, 600) for text in (row.what, row.value, row.option)))


def _lines(row: Remark, widths: tuple[int, int, int]) -> list[str]:
    cells = (row.value, row.what, row.option)
    wrapped = [textwrap.wrap(cell, wide) for cell, wide in zip(cells, widths, strict=True)]
    lines = zip_longest(*wrapped, fillvalue="")
    return ["  ".join(("", *map(str.ljust, line, widths))).rstrip() for line in lines]
