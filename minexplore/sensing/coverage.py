"""Which cells of the workings a robot can reach, and which its beams have seen."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from minexplore.world import World

_BESIDE_M = 0.3  # a cell is 2 m wide: its floor rises within it
_SHARE = 1e-9  # of a cell: sheets so nearly whole cells apart are
_SEAM_M = 1.5  # between the middle of a seam and a place to stand


class CellGrid(Protocol):
    """Cells that robots can see. `reachable` is a mask of them; a row of what a robot has seen has its shape."""

    cell_m: float
    origin_m: np.ndarray
    reachable: np.ndarray
    total: int

    def cells_crossed(self, starts_m: np.ndarray, ends_m: np.ndarray, longest_m: float) -> tuple[np.ndarray, ...]:
        """Return ray numbers of segments (n, 3) to (n, 3) m, and the indices in `reachable` of cells they cross."""

    def mark(self, seen: np.ndarray, observer: np.ndarray, *cell: np.ndarray) -> np.ndarray:
        """Mark cells as seen by their observers; return how many are new to each."""

    def forget(self, seen: np.ndarray, low_m: np.ndarray, high_m: np.ndarray) -> None:
        """Clear what one observer has seen in a box, seen from above."""

    def in_plan(self, cells: np.ndarray) -> np.ndarray:
        """Return the squares (rows, cols), seen from above, in which any of some cells lies."""


@dataclass(frozen=True)
class _SheetGroup:
    """Sheets that are whole cells apart in plan: grid lines cut a segment alike on all of them.

    `aside_m` (2,) is how far all are moved aside, less whole cells; `cols` and `rows` (k,) are each one's whole cells.
    `low_m` and `high_m` (k, 1) are the heights between which something can be on a sheet.
    """

    aside_m: np.ndarray
    cols: np.ndarray
    rows: np.ndarray
    low_m: np.ndarray
    high_m: np.ndarray


class CoverageGrid:
    """Square cells over the mine frame; `reachable[i, j]` covers origin + (j, i) * cell to + (j + 1, i + 1) * cell."""

    def __init__(self, world: World, cell_m: float, radius_m: float, centre_m: np.ndarray, reach_m: float) -> None:
        """Find the cells where a disc of `radius_m` fits, connected to `centre_m` and within `reach_m` of it.

        Raises
        ------
        ValueError
            If the world is one volume, whose floors have no plan, or the disc fits nowhere.
        """
        if world.volume is not None:
            raise ValueError(f"{world.folder}: its mine is one volume; this takes mines whose floors are drawn in plan")
        standing = _connected(world, world.clearance_m >= radius_m, centre_m)
        row, col = np.nonzero(standing)
        places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
        if np.isfinite(reach_m):
            places = places[_distances(world, places, centre_m) <= reach_m]
        self.cell_m = cell_m
        self.origin_m = np.floor(world.origin_m / cell_m) * cell_m
        cols, rows = np.ceil((world.record["world_m"][2:] - self.origin_m) / cell_m).astype(int)
        self.reachable = np.zeros((rows, cols), dtype=bool)
        at = np.floor((places - self.origin_m) / cell_m).astype(int)
        self.reachable[at[:, 1], at[:, 0]] = True
        self.total = int(self.reachable.sum())
        self._floor, height_m = world.floor, float(world.record["height_m"])
        self._roof = self._floor.raised(height_m)
        if len(world.floor.offset_m) > 1:  # between which heights something is in a cell; in others never
            self._low_m, self._high_m = np.full(self.reachable.shape, np.inf), np.zeros(self.reachable.shape)
            level_m, lift_m = world.floor.heights_at(places), world.floor.lifts_at(places, height_m)
            self._low_m[at[:, 1], at[:, 0]] = level_m - _BESIDE_M
            self._high_m[at[:, 1], at[:, 0]] = level_m + height_m + lift_m + _BESIDE_M

    def cells_crossed(
        self, starts_m: np.ndarray, ends_m: np.ndarray, longest_m: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return ray numbers, rows and columns of all cells that segments (n, 3) to (n, 3) pass through.

        Exact: each segment, no longer than `longest_m`, is cut at every grid line it crosses, and each piece names the
        cell of its middle. Of cells of several sheets, a piece names those between whose floor and roof it is.
        """
        if len(self._floor.offset_m) == 1:
            ray, row, col, _ = cut_at_lines(*self._lines, starts_m[:, :2], ends_m[:, :2], longest_m)
            inside = self._holds(row, col)
            return ray[inside], row[inside], col[inside]
        found = []
        for group in self._cut_alike:
            starts, ends = starts_m[:, :2] + group.aside_m, ends_m[:, :2] + group.aside_m
            ray, row, col, share = cut_at_lines(*self._lines, starts, ends, longest_m)
            z = starts_m[ray, 2] + share * (ends_m[ray, 2] - starts_m[ray, 2])
            sheet, piece = np.nonzero((z > group.low_m) & (z < group.high_m))
            row, col = row[piece] + group.rows[sheet], col[piece] + group.cols[sheet]
            held = np.flatnonzero(self._holds(row, col))
            row, col, piece = row[held], col[held], piece[held]
            inside = np.flatnonzero((z[piece] > self._low_m[row, col]) & (z[piece] < self._high_m[row, col]))
            found.append((ray[piece[inside]], row[inside], col[inside]))
        ray, row, col = (np.concatenate(columns) for columns in zip(*found, strict=True))
        return ray, row, col

    @property
    def _lines(self) -> tuple[np.ndarray, float]:
        return self.origin_m, self.cell_m

    @functools.cached_property
    def _cut_alike(self) -> list[_SheetGroup]:
        """Return the sheets by groups, on which grid lines cut a segment alike."""
        cells = np.floor(self._floor.offset_m / self.cell_m + _SHARE)
        aside_m = self._floor.offset_m - cells * self.cell_m
        _, first, group = np.unique(
            np.round(aside_m / (_SHARE * self.cell_m)), axis=0, return_index=True, return_inverse=True
        )
        low_m, high_m = self._floor.spans_m[:, :1] - _BESIDE_M, self._roof.spans_m[:, 1:] + _BESIDE_M
        cols, rows = cells.astype(int).T
        own = [np.flatnonzero(group.reshape(-1) == number) for number in range(len(first))]
        return [
            _SheetGroup(aside_m[sheets[0]], cols[sheets], rows[sheets], low_m[sheets], high_m[sheets]) for sheets in own
        ]

    def _holds(self, row: np.ndarray, col: np.ndarray) -> np.ndarray:
        """Return whether cells (n,) are the grid's."""
        rows, cols = self.reachable.shape
        return (col >= 0) & (col < cols) & (row >= 0) & (row < rows)

    def mark(self, seen: np.ndarray, observer: np.ndarray, *cell: np.ndarray) -> np.ndarray:
        """Mark cells, rows and columns, as seen in `seen` (m, rows, cols) by their observers.

        Return how many are new to each (m,).
        """
        row, col = cell
        useful = self.reachable[row, col]
        flat = np.ravel_multi_index((observer[useful], row[useful], col[useful]), seen.shape)
        view = seen.reshape(-1)
        new = np.unique(flat[~view[flat]])
        view[new] = True
        return np.bincount(new // self.reachable.size, minlength=len(seen))

    def forget(self, seen: np.ndarray, low_m: np.ndarray, high_m: np.ndarray) -> None:
        """Clear the cells of one observer (rows, cols) that meet a box of the plan (2,) to (2,) m."""
        low, high = np.floor((np.stack([low_m, high_m]) - self.origin_m) / self.cell_m).astype(int)
        (west, south), (east, north) = np.maximum(low, 0), np.maximum(high + 1, 0)
        seen[south:north, west:east] = False

    def in_plan(self, cells: np.ndarray) -> np.ndarray:
        """Return a mask of cells as one of the plan's squares (rows, cols): here they are the same."""
        return cells


def cut_at_lines(
    origin_m: np.ndarray, cell_m: float, starts_m: np.ndarray, ends_m: np.ndarray, longest_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return ray numbers, rows, columns and middles, as shares of segments, of the pieces between a grid's lines.

    Segments (n, 2) to (n, 2) m are at most `longest_m` long.
    """
    start, ends = (starts_m - origin_m) / cell_m, (ends_m - origin_m) / cell_m
    step = ends - start
    lines = np.arange(1, int(np.ceil(longest_m / cell_m)) + 2)
    ahead = np.where(step > 0, np.floor(start), np.ceil(start))  # (n, 2): the line behind the start on either axis
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (ahead[..., None] + np.sign(step)[..., None] * lines - start[..., None]) / step[..., None]
    share = np.where((share > 0) & (share < 1), share, 1.0).reshape(len(start), -1)
    at = np.sort(np.hstack([np.zeros((len(start), 1)), share, np.ones((len(start), 1))]), axis=1)
    ray, piece = np.nonzero(at[:, 1:] > at[:, :-1])
    middle = (at[ray, piece + 1] + at[ray, piece]) / 2
    col, row = np.floor(start[ray] + middle[:, None] * step[ray]).astype(int).T
    return ray, row, col, middle


def _distances(world: World, places: np.ndarray, centre_m: np.ndarray) -> np.ndarray:
    """Return the distances (n,) m in the mine frame, seen from above, of places (n, 2) m of the plan from one."""
    if len(world.floor.offset_m) > 1:
        places = places - world.floor.offsets_at(places)
        centre_m = centre_m - world.floor.offsets_at(centre_m[None])[0]
    return np.linalg.norm(places - centre_m, axis=1)


def _connected(world: World, standing: np.ndarray, centre_m: np.ndarray) -> np.ndarray:
    """Return the cells of a mask that are connected to the one nearest to a place."""
    row, col = np.nonzero(standing)
    if not len(row):
        raise ValueError(f"{world.folder}: no place where the robot fits")
    places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
    seed = int(np.linalg.norm(places - centre_m, axis=1).argmin())
    unseen = np.pad(standing, 1)  # a border of rock: no step leaves the grid
    width = unseen.shape[1]
    beside = np.array([1, -1, width, -width])
    across = {
        _padded(one, width): [_padded(cell, width) for cell in others]
        for one, others in _across_seams(world, row, col, places).items()
    }
    edge, left = np.array([_padded((row[seed], col[seed]), width)]), unseen.reshape(-1)
    while len(edge):  # all cells that are one step farther at a time
        left[edge] = False
        over = [cell for one in edge.tolist() for cell in across.get(one, ())] if across else []
        edge = np.append((edge[:, None] + beside).ravel(), np.array(over, dtype=int))
        edge = np.unique(edge[left[edge]])
    return standing & ~unseen[1:-1, 1:-1]


def _padded(cell: tuple[int, int], width: int) -> int:
    """Return the flat index of a cell (row, column) in the grid with a border, which has so many columns."""
    return int((cell[0] + 1) * width + cell[1] + 1)


def _across_seams(
    world: World, row: np.ndarray, col: np.ndarray, places: np.ndarray
) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """Return the standing cells beside each seam between two sheets, each with its neighbour on the other sheet."""
    across: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for seam in world.floor.seams():
        near = [int(np.linalg.norm(places - middle, axis=1).argmin()) for middle in seam]
        if max(float(np.linalg.norm(places[k] - middle)) for k, middle in zip(near, seam, strict=True)) > _SEAM_M:
            continue
        one, two = ((int(row[k]), int(col[k])) for k in near)
        across.setdefault(one, []).append(two)
        across.setdefault(two, []).append(one)
    return across
