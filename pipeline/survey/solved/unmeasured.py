"""Remarks on what of a survey nobody measured."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipeline.guard.reading_process import warn_user


def warn_of_strays(path: Path, count: int) -> None:
    """Warn of splays that end in a passage that is not near along the survey."""
    if count:
        warn_user(
            "splays go through windows into passages that are not near along the survey; they measure no "
            "wall of their own passage",
            of=path.name,
            count=count,
        )


def warn_of_floors(path: Path, rows: Sequence[tuple[list[int], np.ndarray]]) -> None:
    """Warn of stations whose distance down is interpolated along the survey, as others have one."""
    nodes = {node for row, _ in rows for node in row}
    known = {node for row, walls in rows for node, down in zip(row, walls[:, 3], strict=True) if np.isfinite(down)}
    if known and len(known) < len(nodes):
        warn_user(
            "stations have no measured distance down to the floor; it is interpolated along the legs "
            "between those that have one, and is their median beyond them",
            of=path.name,
            count=f"{len(nodes) - len(known)} of {len(nodes)}",
        )
