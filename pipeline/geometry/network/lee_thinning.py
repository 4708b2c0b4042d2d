"""Thin a mask by the method of Lee, Kashyap and Chu, in time that grows with its free cells and not with its box."""

from __future__ import annotations

import numpy as np

from pipeline.types import Mask

# Around a cell, in turn from the north-west: a neighbour's bit is its place here.
_AROUND = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
_EARLIER = 4  # of them are before the cell, row by row
_ROCK, _INSIDE, _RIM, _STAYS, _GOES = range(5)  # of a cell: beside free cells only, beside rock, tried
_SIDES = (1, 6, 4, 3)  # whose cells are taken in turn: those with no neighbour to the north, south, east and west


def thin_mask(cells: Mask) -> np.ndarray:
    """Return the cells (n, 2) of a mask's skeleton, row and column, row by row.

    It is that of `skimage.morphology.skeletonize(cells, method="lee")`. In turn for the four sides, cells are found
    whose removal changes no connection, and removed row by row if that still holds; ends of lines stay. Scikit-image
    reads the whole mask each time; here only cells beside rock are looked at.

    Parameters
    ----------
    cells : (rows, cols) bool

    References
    ----------
    Lee, Kashyap & Chu 1994, doi:10.1006/cgip.1994.1042
    """
    width = cells.shape[1] + 2
    step = np.array([down * width + right for down, right in _AROUND])
    state = np.pad(cells.view(np.uint8), 1).ravel()
    free = np.flatnonzero(state)
    rim = np.concatenate([_bared(state, free[state[free + step[side]] == _ROCK]) for side in _SIDES])
    unchanged = 0
    while unchanged < len(_SIDES):
        unchanged = 0
        for side in _SIDES:
            removed = _remove(state, rim[state[rim + step[side]] == _ROCK], step)
            bared = [_bared(state, removed + step[beside]) for beside in _SIDES]
            rim = np.concatenate([rim[state[rim] == _RIM], *bared])
            unchanged += not len(removed)
    return np.column_stack(np.divmod(free[state[free] != _ROCK], width)) - 1


def _bared(state: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return those of different cells that were inside, and mark them as beside rock."""
    found = cells[state[cells] == _INSIDE]
    state[found] = _RIM
    return found


def _remove(state: np.ndarray, cells: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Remove those cells that go when they are tried row by row, and return them.

    Whether a cell goes depends on its neighbours before it alone. All are taken to go at first, and those after a cell
    of which that was wrong are tried again, until none is.
    """
    around = np.zeros(len(cells), np.uint8)
    for bit, beside in enumerate(step):
        around |= (state[cells + beside] != _ROCK).view(np.uint8) << bit
    is_tried = _IS_LINK[around] & (_COUNT[around] > 1)
    cells, around = cells[is_tried], around[is_tried]
    state[cells] = _GOES
    active = np.arange(len(cells))
    number = dict[int, int]()
    while len(active):
        at = cells[active]
        gone = np.zeros(len(at), np.uint8)
        for bit, beside in enumerate(step[:_EARLIER]):
            gone |= (state[at + beside] == _GOES).view(np.uint8) << bit
        goes = _IS_LINK[around[active] & ~gone]
        wrong = goes != (state[at] == _GOES)
        state[at] = np.where(goes, _GOES, _STAYS)
        after = np.unique(at[wrong, None] + step[_EARLIER:])
        after = after[state[after] >= _STAYS]
        if len(after) and not number:
            number = dict(zip(cells.tolist(), range(len(cells)), strict=True))
        active = np.array([number[cell] for cell in after.tolist()], np.int64)
    is_gone = state[cells] == _GOES
    state[cells] = np.where(is_gone, _ROCK, _RIM)
    return cells[is_gone]


def _links() -> np.ndarray:
    """Return for each set of neighbours (256,) whether they are connected without the cell; none is, too."""
    apart = np.abs(np.array(_AROUND)[:, None] - _AROUND).max(axis=2)
    found = np.zeros(256, bool)
    for neighbours in range(256):
        left = [bit for bit in range(8) if neighbours >> bit & 1]
        reached = left[:1]
        for bit in reached:
            reached += [other for other in left if other not in reached and apart[bit, other] == 1]
        found[neighbours] = len(reached) == len(left)
    return found


_IS_LINK = _links()
_COUNT = np.array([number.bit_count() for number in range(256)])
