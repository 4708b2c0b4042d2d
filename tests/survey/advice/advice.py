"""A refusal that names a way on, with a file that is refused and what to do about it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

Write = Callable[[Path], Path]


@dataclass(frozen=True)
class WayOn:
    """What follows an advice: options, and another file if the advice is about the file."""

    stated: dict[str, Any] = field(default_factory=dict)
    write: Write | None = None


@dataclass(frozen=True)
class Advice:
    """A refusal.

    Parameters
    ----------
    words : str
        Words of the message, as they stand in the code.
    write : function
        Writes the file that is refused into a folder, and returns it.
    stated : dict
        The options with which it is refused.
    ways : tuple of WayOn
        Each follows the advice, and the file is read.
    """

    words: str
    write: Write
    stated: dict[str, Any]
    ways: tuple[WayOn, ...]


def by(**stated: Any) -> WayOn:
    """Return a way of options alone."""
    return WayOn(stated)
