"""Progress of long loops: a bar on a terminal, elsewhere a line now and then; a short loop shows nothing."""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

from tqdm import tqdm

AFTER_S = 5.0  # of a loop that is shown
_EVERY_S = 5.0  # between lines where standard error is no terminal
_LINE = "{desc}: {n_fmt} of {total_fmt} {unit}, {remaining} left"
_Item = TypeVar("_Item")


def counted(items: Sequence[_Item], title: str, unit: str) -> Iterable[_Item]:
    """Return items one by one, and show how many are done and how long the rest takes."""
    return progress(title, len(items), unit, items)


def progress(title: str, total: int, unit: str, items: Iterable[Any] | None = None) -> tqdm:
    """Return a bar to `update`, within a `with`; it shows nothing in one of many processes that one command began."""
    tqdm.monitor_interval = 0  # no thread beside this one: reading a survey forks
    of_many = multiprocessing.parent_process() is not None
    shown: dict[str, Any] = {"desc": title, "total": total, "unit": unit, "delay": AFTER_S, "disable": of_many}
    if sys.stderr.isatty():
        return tqdm(items, leave=False, **shown)
    return _Lines(items, bar_format=_LINE, mininterval=_EVERY_S, **shown)


class _Lines(tqdm):
    """Prints lines, where tqdm would move the cursor of a terminal."""

    def display(self, msg: str | None = None, pos: int | None = None) -> None:
        print(self, file=sys.stderr, flush=True)

    def close(self) -> None:
        self.disable = True
