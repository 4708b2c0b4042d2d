"""End a case whose time by the clock is over, unless other work on the machine has starved it."""

from __future__ import annotations

import signal
import time
from contextlib import suppress
from pathlib import Path

_LOOKS, _LOOK_S, _AGAIN_S = 20, 0.05, 2.0  # at whether a process sleeps, when a case's time by the clock is over
_ASLEEP_S = 0.01  # of the processor since the last look, s, at most: the reader waits for nothing


class HangError(BaseException):
    """The time limit is exceeded. It is a BaseException so that no reader catches it."""


class Alarm:
    """Ends a case, unless its reader or a process that this started computes: a busy machine may have starved it."""

    def __init__(self, most_s: float) -> None:
        self._end_s = time.process_time() + most_s
        self._seen_s = time.process_time()

    def __call__(self, *_: object) -> None:
        """Raise, or look again in a while."""
        used_s = time.process_time()
        computes = self._seen_s + _ASLEEP_S < used_s < self._end_s
        for _look in range(_LOOKS):
            if computes or any(_state(pid) == "R" for pid in _started("self")):
                self._seen_s = time.process_time()
                signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
                return
            time.sleep(_LOOK_S)
        raise HangError


def _started(pid: str) -> list[str]:
    """Return the processes that one has started, and those that they have (Linux)."""
    found: list[str] = []
    for file in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):  # it has ended
            found += file.read_text().split()
    return found + [further for child in found for further in _started(child)]


def _state(pid: str) -> str:
    with suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    return ""
