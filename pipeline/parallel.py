"""Work on several cores, by threads: NumPy, SciPy, GEOS, Embree and OpenCV let other threads run while they compute.

A thread shares what this process holds, and nothing is copied. What holds the interpreter gains nothing; ADR 27 has
what was measured.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from typing import Any, TypeVar

_T = TypeVar("_T")
_MOST = 4  # threads
_SHARES = 4  # of the work, to each thread: what takes long in one is made up for by the others


def together(*works: Callable[[], Any]) -> list[Any]:
    """Return what each function returns, in order; they run at the same time, each in the caller's context.

    Raises
    ------
    Exception
        That of the first function that failed, once all have ended.
    """
    with ThreadPoolExecutor(len(works)) as pool:
        waiting = [pool.submit(copy_context().run, work) for work in works]
    return [one.result() for one in waiting]


def in_shares(work: Callable[[int, int], _T], count: int, least: int = 1) -> list[_T]:
    """Return what `work` returns for ranges of numbers that together are 0 to `count`, in order, by all cores.

    `work` takes the first number and the one after the last. What it returns for each number must not depend on the
    range, so that it is the same on any number of cores. A range has at least `least` numbers: fewer are not worth a
    thread.

    Raises
    ------
    Exception
        That of the first range that failed.
    """
    threads = min(os.cpu_count() or 1, _MOST)
    shares = min(threads * _SHARES, count // least)
    if threads < 2 or shares < 2:
        return [work(0, count)] if count else []
    ends = [count * k // shares for k in range(shares + 1)]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, ends, ends[1:]))
