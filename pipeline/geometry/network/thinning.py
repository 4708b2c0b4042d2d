"""Thin a polygon on a grid; the skeleton is linked pixels."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely import Polygon

from pipeline.geometry.network.lee_thinning import thin_mask
from pipeline.geometry.rasterize import fill_polygon
from pipeline.geometry.runs import connected_runs
from pipeline.types import Frame, Mask

_ON_EDGE_M = 1e-6  # the middle of a pillar's first cell may be on its edge


@dataclass(frozen=True)
class Skeleton:
    """Pixels (n, 2) of row and column, row by row, and the links (m, 2) between neighbours by their numbers.

    A link names its lower number first; links are in the order of these.
    """

    pixels: np.ndarray
    links: np.ndarray

    def parts(self, links: np.ndarray) -> np.ndarray:
        """Return the part (n,) of each pixel by some of the links (k, 2), numbered by their first pixels."""
        n = len(self.pixels)
        found = connected_components(coo_array((np.ones(len(links), bool), links.T), shape=(n, n)), directed=False)[1]
        _, first, part = np.unique(found, return_index=True, return_inverse=True)
        return np.argsort(np.argsort(first))[part]

    @property
    def components(self) -> int:
        """Return the number of connected components."""
        return int(self.parts(self.links).max(initial=-1)) + 1

    @property
    def loops(self) -> int:
        """Return the cycle rank."""
        return len(self.links) - len(self.pixels) + self.components


def thin_polygon(free: Polygon, cell_m: float) -> tuple[Skeleton, Frame]:
    """Rasterise and thin a polygon, m; return its skeleton and the grid.

    References
    ----------
    Lee, Kashyap & Chu 1994, doi:10.1006/cgip.1994.1042 (it keeps holes and components, which the method of Zhang and
    Suen does not always)
    """
    west, south, east, north = free.bounds
    width, height = (int(np.ceil(size / cell_m)) + 4 for size in (east - west, north - south))
    frame = Frame(1.0 / cell_m, 2.0 - west / cell_m, height - 2.0 + south / cell_m, width, height)
    cells = _without_tips(fill_polygon(free, frame), free, frame)
    return skeleton_of(_with_neighbour(thin_mask(cells), cells)), frame


def _with_neighbour(pixels: np.ndarray, cells: Mask) -> np.ndarray:
    """Add a free neighbour to a skeleton of one cell: a square or round room then has a leg, one cell long."""
    if len(pixels) != 1:
        return pixels
    ((row, col),) = pixels.tolist()
    sides = [(row, col + 1), (row + 1, col), (row, col - 1), (row - 1, col)]
    return np.array(sorted([(row, col), *[side for side in sides if cells[side]][:1]]))


def _without_tips(cells: Mask, free: Polygon, frame: Frame) -> Mask:
    """Mark as free the cells of rock cut off from their pillar: its sharp tip is not a second island.

    A tip is at most two cells thick. What is thicker hangs on a neck of rock that only finer cells show.
    """
    rock = connected_runs(~cells)
    if rock.parts == len(free.interiors) + 1:
        return cells
    places = frame.to_mine(np.column_stack([rock.start, rock.row])[rock.first] + 0.5)
    pillars = shapely.STRtree([Polygon(ring) for ring in free.interiors])
    part, pillar = pillars.query(shapely.points(places), "dwithin", _ON_EDGE_M)
    pillar_of = np.zeros(rock.parts, int)  # 0 is the rock outside
    pillar_of[part] = pillar + 1
    by_size, whole = np.argsort(rock.sizes, kind="stable"), np.full(len(free.interiors) + 1, -1)
    whole[pillar_of[by_size]] = by_size  # the largest piece of each stays
    inner = cv2.erode((~cells).astype(np.uint8), np.ones((3, 3), np.uint8))
    apart = np.flatnonzero(~np.isin(rock.part, whole))
    runs = [(rock.row[run], slice(rock.start[run], rock.stop[run])) for run in apart.tolist()]
    thick = rock.part[apart][[bool(inner[run].any()) for run in runs]]
    for run, part in zip(runs, rock.part[apart].tolist(), strict=True):
        if part not in thick:
            cells[run] = True
    return cells


def skeleton_of(pixels: np.ndarray) -> Skeleton:
    """Connect neighbouring pixels (n, 2), which are in order; diagonally only if no two orthogonal steps connect them.

    Thinning can leave a square of four pixels where drifts cross. It is no loop, so one of its four edges is left out.
    """
    row, col = pixels.T
    width = int(col.max(initial=0)) + 3  # columns beside the pixels have keys, too
    key = row * width + col + 1

    def numbers_beside(down: int, right: int) -> np.ndarray:
        """Return the number of the pixel so many rows below and columns to the right of each; -1 where none is."""
        wanted = key + down * width + right
        at = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
        return np.where(key[at] == wanted, at, -1)

    east, south, south_west, south_east = (numbers_beside(*step) for step in ((0, 1), (1, 0), (1, -1), (1, 1)))
    west, closes_square = numbers_beside(0, -1), (numbers_beside(-1, 0) >= 0) & (numbers_beside(-1, 1) >= 0)
    neighbour = np.column_stack(
        [
            np.where(closes_square, -1, east),
            south,
            np.where((south >= 0) | (west >= 0), -1, south_west),
            np.where((south >= 0) | (east >= 0), -1, south_east),
        ]
    )
    one, which = np.nonzero(neighbour >= 0)
    return Skeleton(pixels, np.column_stack([one, neighbour[one, which]]))
