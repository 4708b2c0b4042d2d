"""Where a scanner was: a text file with rows of time and place."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.guard.plain_file import read_text_bytes, require_at_most
from pipeline.guard.plain_number import plain_number


def read_trajectory(path: Path) -> np.ndarray:
    """Return the places (n, 3) of rows `time x y z ...`, in the file's unit; lines that begin with # are no rows.

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
            row = [plain_number(word) for word in words[1:4]]
        except ValueError:
            row = []
        if len(row) != 3 or not np.isfinite(row).all():
            raise InputError(f"{path}:{number}: {line.strip()[:60]!r} is no row of time x y z")
        rows.append(row)
        require_at_most(path, len(rows), "sweep_rows", "rows or more")
    if not rows:
        raise InputError(f"{path}: no rows of time x y z")
    return np.array(rows)
