"""The stations of a survey that are built, and their workings by place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from pipeline.survey.passages.sheet_cells import Cell

BESIDE_M = 1.5  # workings so near to a shaft's middle in plan are in its way
USUAL_ROOF_M = 3.5  # over the floor where none is surveyed: the default of `compile3d.height_m`


@dataclass(frozen=True)
class Built:
    """The stations that are built: their cells, sheets, how far these are moved aside (k, 2) m, and the datum, m."""

    cells: dict[str, Cell]
    sheet: dict[str, int]
    offsets: np.ndarray
    datum_m: float


class BuiltCells:
    """The built cells by place."""

    def __init__(self, built: Built) -> None:
        """Take the cells of the built stations."""
        owned = [(built.cells[name], shape) for name in built.sheet for shape in built.cells[name].shapes]
        self._cells = [cell for cell, _ in owned]
        self._tree = shapely.STRtree([shape for _, shape in owned])

    def between(self, place_m: np.ndarray, low_m: float, high_m: float, beside_m: float = BESIDE_M) -> bool:
        """Return whether there is floor between two heights about a place (2,) m."""
        x, y = place_m.tolist()
        near = self._tree.query(shapely.Point(x, y), predicate="dwithin", distance=beside_m)
        return any(low_m < self._cells[k].height_at(x, y) < high_m for k in near.tolist())

    def spans(self, place_m: np.ndarray, beside_m: float) -> np.ndarray:
        """Return the lowest floor and the highest roof (k, 2) m of each cell so near to a place (2,) m."""
        x, y = place_m.tolist()
        near = self._tree.query(shapely.Point(x, y), predicate="dwithin", distance=beside_m)
        found = []
        for cell in (self._cells[k] for k in near.tolist()):
            round_m = [(x, y), *((x + beside_m * c, y + beside_m * s) for c, s in ((1, 0), (-1, 0), (0, 1), (0, -1)))]
            floors = [cell.height_at(*place) for place in round_m]
            roofs = [(line[:, 3] + line[:, 4] * USUAL_ROOF_M).max() for line in cell.lines]
            found.append((min(floors), max(floors) + max(roofs, default=USUAL_ROOF_M)))
        return np.array(found, dtype=float).reshape(-1, 2)
