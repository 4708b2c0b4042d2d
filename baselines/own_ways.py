"""Rows of a table must show ways of their own: a file that mostly repeats another one is refused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path

from baselines.errors import RejectedError
from baselines.result_file import Episode

_SHARE = 0.5  # of the episodes; no two kept rows agree in a single one


def require_own_ways(files: Mapping[Path, Sequence[Episode]]) -> None:
    """Refuse a file of which more than half of the episodes drive the way of the same episode of another file.

    Robots that stand still have no way of their own and are not counted.

    Raises
    ------
    RejectedError
        Naming both files and the number of equal ways.
    """
    for (first, ours), (second, theirs) in combinations(files.items(), 2):
        pairs = [(a, b) for a, b in zip(ours, theirs, strict=False) if max(a.path_m, b.path_m) > 1]
        same = sum(a.path_cm == b.path_cm for a, b in pairs)
        if same > _SHARE * len(pairs):
            raise RejectedError(f"{second}: its robots drive the ways of {first}: {same} of {len(pairs)} are equal")
