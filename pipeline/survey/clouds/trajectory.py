"""Where a scanner was: a text file with rows of time and place."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import read_text_bytes, require_at_most
from minesurveys.guard.plain_number import plain_number


@dataclass(frozen=True)
class Trajectory:
    """The places (n, 3) of a scanner and their times (n,), s, in ascending order."""

    time_s: np.ndarray
    places: np.ndarray

    @property
    def has_clock(self) -> bool:
        """Return whether times differ: rows of one time are places alone."""
        return bool(self.time_s[0] < self.time_s[-1])

    def at(self, time_s: np.ndarray) -> np.ndarray:
        """Return the places (k, 3) at times (k,), on straight lines between rows; NaN before and after all rows."""
        found = np.column_stack([np.interp(time_s, self.time_s, axis) for axis in self.places.T])
        found[~((time_s >= self.time_s[0]) & (time_s <= self.time_s[-1]))] = np.nan
        return found


def read_trajectory(path: Path) -> Trajectory:
    """Return rows `time x y z ...`, places in the file's unit; lines that begin with # are no rows.

    Raises
    ------
    InputError
        If a row has fewer than four numbers, or there is none. The message names the line.
    """
    text = read_text_bytes(path).decode("utf-8", "replace")
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            row = [plain_number(word) for word in words[:4]]
        except ValueError:
            row = []
        if len(row) != 4 or not np.isfinite(row).all():
            raise InputError(f"{path}:{number}: {line.strip()[:60]!r} is no row of time x y z")
        rows.append(row)
        require_at_most(path, len(rows), "sweep_rows", "rows or more")
    if not rows:
        raise InputError(f"{path}: no rows of time x y z")
    found = np.array(rows)
    found = found[np.argsort(found[:, 0], kind="stable")]
    return Trajectory(found[:, 0], found[:, 1:])
