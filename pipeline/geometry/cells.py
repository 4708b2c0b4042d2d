"""Square cells of the plan that hold places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.geometry.sorting import stable_order


@dataclass(frozen=True)
class PlanCells:
    """Cells that hold places: column and row (k, 2) of each, in lexical order, and each place's cell (n,)."""

    at: np.ndarray
    of_place: np.ndarray


def plan_cells(places: np.ndarray, size_m: float) -> PlanCells:
    """Return the cells, squares of a size from the origin, that places (n, 2), m, lie in."""
    col, row = np.floor(places.T / size_m).astype(np.int64)
    west, south = col.min(initial=0), row.min(initial=0)
    number = (col - west) * (row.max(initial=0) - south + 1) + row - south
    order = stable_order(number)
    is_first = np.diff(number[order], prepend=-1) != 0
    of_place = np.empty(len(places), dtype=np.int64)
    of_place[order] = np.cumsum(is_first) - 1
    first = order[is_first]
    return PlanCells(np.column_stack([col[first], row[first]]), of_place)
