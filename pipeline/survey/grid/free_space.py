"""The free space of an occupancy grid that becomes the workings: one connected area."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from minesurveys.errors import DoubtError, InputError
from minesurveys.remarks import warn_user
from pipeline.geometry.outline.components import NEAR_M
from pipeline.survey.grid.placement import GridPlacement
from pipeline.types import Image, Mask

_SMALLEST_M2 = 4.0  # a robot of 0.7 m that turns and passes another one needs 2 m a side
_NAMED_M2 = 1.0  # smaller areas that are left out are counted, not named
_NEAR_SHARE = 0.5  # an area of this share of the largest could be meant too
_AROUND_M2 = 10.0  # an area that may be meant where the largest one surrounds it
_MOST_NAMED = 4
_FREE, _SOLID = 255, 60  # grey values of the picture of a question


@dataclass(frozen=True)
class FreeCells:
    """The free cells that are built (rows, cols; row 0 in the south), all connected, their place and files."""

    cells: Mask
    placement: GridPlacement
    files: tuple[Path, ...] = ()


@dataclass(frozen=True)
class _Areas:
    """The free areas of a grid: `labels` (rows, cols) from 1, and their sizes, m2, with a place inside of each."""

    labels: np.ndarray
    sizes_m2: np.ndarray
    boxes: np.ndarray
    placement: GridPlacement

    def mask(self, number: int) -> Mask:
        return np.asarray(self.labels == number + 1)

    def place_in(self, number: int) -> tuple[float, float]:
        """Return the place (m, mine frame) in an area that is farthest from its walls."""
        col, row, cols, rows = self.boxes[number]
        part = np.pad(self.labels[row : row + rows, col : col + cols] == number + 1, 1).astype(np.uint8)
        at = np.unravel_index(int(cv2.distanceTransform(part, cv2.DIST_L2, 3).argmax()), part.shape)
        (x, y) = self.placement.to_mine(np.array([[col + at[1] - 0.5, row + at[0] - 0.5]]))[0]
        return float(x), float(y)

    def describe(self, number: int) -> str:
        x, y = self.place_in(number)
        return f"{self.sizes_m2[number]:.0f} m2 at ({x:.1f}, {y:.1f})"


def choose_free_space(path: Path, free: Mask, placement: GridPlacement, start_m: tuple[float, ...] | None) -> FreeCells:
    """Return the connected free area that holds the start, or else the largest.

    If another area is half as large as the largest, or the largest lies around others up to the edges of the grid, the
    area at the map's origin is taken, where a robot that made the map started.

    Parameters
    ----------
    path : Path
        Of the map; messages name it.
    free : (rows, cols) bool
        Row 0 in the south.
    placement : GridPlacement
    start_m : tuple or None
        Where robots start, m, mine frame.

    Raises
    ------
    DoubtError
        If several areas could be meant and none is at the map's origin. The message lists them.
    InputError
        If no free area is large enough, or none is at the start.
    """
    areas = _find_areas(free, placement)
    if areas.sizes_m2.max(initial=0.0) < _SMALLEST_M2:
        raise InputError(
            f"{path}: no connected floor: the largest of {len(areas.sizes_m2)} free areas that are wide enough has "
            f"{areas.sizes_m2.max(initial=0.0):.1f} m2, at least {_SMALLEST_M2:g} m2 are needed; --narrowest 0 "
            "--thinnest 0 keep the map's cells as they are"
        )
    chosen = _chosen(path, free, areas, start_m)
    _warn_of_others(path, areas, chosen)
    return FreeCells(areas.mask(chosen), placement)


def _find_areas(free: Mask, placement: GridPlacement) -> _Areas:
    _, labels, stats, _ = cv2.connectedComponentsWithStats(free.astype(np.uint8), connectivity=4)
    return _Areas(labels, stats[1:, cv2.CC_STAT_AREA] * placement.cell_m**2, stats[1:, :4], placement)


def _chosen(path: Path, free: Mask, areas: _Areas, start_m: tuple[float, ...] | None) -> int:
    if start_m is not None:
        return _area_at(path, areas, start_m)
    candidates = _candidates(areas)
    if len(candidates) == 1:
        return candidates[0]
    at_origin = areas.placement.cell_of_map((0.0, 0.0))
    number = _label_at(areas.labels, at_origin) - 1
    if number in candidates:
        warn_user(
            f"of {len(candidates)} free areas that at the map's origin is built, {areas.describe(number)}",
            of=path.name,
            option="--start",
            advice="--start E,N chooses another",
        )
        return number
    named = ", ".join(areas.describe(number) for number in candidates[:_MOST_NAMED])
    raise DoubtError(
        f"{path}: {len(candidates)} free areas could be the workings: {named}; --start E,N states a place in one",
        _draw(free, areas, candidates),
    )


def _candidates(areas: _Areas) -> list[int]:
    """Return the numbers of the areas that could be meant, the largest first."""
    order = np.argsort(-areas.sizes_m2, kind="stable")
    largest = int(order[0])
    rows, cols = areas.labels.shape
    is_around = areas.boxes[largest].tolist() == [0, 0, cols, rows]
    least = min(_NEAR_SHARE * areas.sizes_m2[largest], _AROUND_M2 if is_around else np.inf)
    return [int(k) for k in order if k == largest or areas.sizes_m2[k] >= least]


def _label_at(labels: np.ndarray, cell: tuple[int, int]) -> int:
    col, row = cell
    rows, cols = labels.shape
    return int(labels[row, col]) if 0 <= row < rows and 0 <= col < cols else 0


def _area_at(path: Path, areas: _Areas, start_m: tuple[float, ...]) -> int:
    """Return the area that holds a start, or the nearest one."""
    col, row = areas.placement.to_cells(np.array([start_m[:2]]))[0]
    reach = NEAR_M / areas.placement.cell_m
    low_col, low_row = (int(max(0, np.floor(at - reach))) for at in (col, row))
    part = areas.labels[low_row : max(0, int(row + reach) + 1), low_col : max(0, int(col + reach) + 1)]
    rows, cols = np.nonzero(part)
    apart = np.hypot(cols + low_col + 0.5 - col, rows + low_row + 0.5 - row)
    if not len(apart) or apart.min() > reach:
        raise InputError(
            f"{path}: --start {start_m[0]:g},{start_m[1]:g}: no free area within {NEAR_M:g} m; the largest has "
            f"{areas.describe(int(areas.sizes_m2.argmax()))}"
        )
    at = int(apart.argmin())
    return int(part[rows[at], cols[at]]) - 1


def _warn_of_others(path: Path, areas: _Areas, chosen: int) -> None:
    others = [int(k) for k in np.argsort(-areas.sizes_m2, kind="stable") if k != chosen]
    if not others or areas.sizes_m2[others].sum() < _NAMED_M2:
        return
    count = f"{len(others)} other free areas" if len(others) > 1 else "another free area"
    verb = "are" if len(others) > 1 else "is"
    warn_user(
        f"{count}, {areas.sizes_m2[others].sum():.0f} m2, {verb} left out, the largest of {areas.describe(others[0])}",
        of=path.name,
        option="--start",
        advice="--start E,N",
    )


def _draw(free: Mask, areas: _Areas, candidates: list[int]) -> Image:
    """Draw the grid, north up, with the areas of a question green, paler from one to the next."""
    picture = cv2.cvtColor(np.where(free, _FREE, _SOLID).astype(np.uint8), cv2.COLOR_GRAY2BGR)
    for k, number in enumerate(candidates[:_MOST_NAMED]):
        picture[areas.mask(number)] = (40 + 40 * k, 160 + 20 * k, 40 + 40 * k)
    return np.ascontiguousarray(picture[::-1])
