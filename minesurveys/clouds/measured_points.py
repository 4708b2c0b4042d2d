"""Points that a scanner measured: rows of points that it did not are left out, counted by what they hold instead."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from minesurveys.clouds.point_blocks import PointBlock
from minesurveys.errors import InputError
from minesurveys.remarks import warn_user


def measured(path: Path, blocks: Iterator[PointBlock]) -> Iterator[PointBlock]:
    """Yield the blocks without points that are no finite numbers, or lie at 0 0 0, with a warning at the end.

    Organised clouds have a row for each direction. Where nothing came back, it is NaN in PCD and PLY files, and 0 0 0,
    the scanner's own place, in others.

    Raises
    ------
    InputError
        If no point is left.
    """
    no_numbers = zeros = left = 0
    for block in blocks:
        finite = np.isfinite(block.points).all(axis=1)
        kept = finite & block.points.any(axis=1)
        no_numbers, zeros = no_numbers + int((~finite).sum()), zeros + int((finite & ~kept).sum())
        left += int(kept.sum())
        yield block if kept.all() else _some(block, kept)
    count = no_numbers + zeros + left
    if count and not left:
        raise InputError(f"{path}: none of its {count} points was measured: {no_numbers} are NaN, {zeros} lie at 0 0 0")
    for rows, what in ((no_numbers, "are no finite numbers (NaN)"), (zeros, "lie at 0 0 0")):
        if rows:
            warn_user(
                f"points {what}, as scanners write what they missed; left out", of=path.name, count=f"{rows} of {count}"
            )


def _some(block: PointBlock, kept: np.ndarray) -> PointBlock:
    colours, times = (None if each is None else each[kept] for each in (block.colours, block.times))
    return replace(block, points=block.points[kept], colours=colours, times=times)
