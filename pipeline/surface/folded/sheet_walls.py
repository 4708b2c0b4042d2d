"""The walls of a mine of several sheets: columns from seam to seam, and columns in the open air along the seams."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d, minimum_filter1d
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from minexplore.floors.floor import Floor
from pipeline.errors import GeometryError
from pipeline.geometry.floor.seams import SeamLine, behind_seam, continue_sheets, seam_lines, seams_of_edges
from pipeline.geometry.polyline import arc_length
from pipeline.surface.mesh.walls import (
    EVEN_M,
    TURN_M,
    Ring,
    SheetColumns,
    WallColumns,
    fillet,
    largest_discs,
    narrowest_half_width,
    passages,
    smoothstep,
)
from pipeline.types import DriftNetwork

_BEHIND_M = 1.5  # of the next sheet, that corners near a seam are rounded with
_APART_M = 0.05  # the rounding of corners may part the walls of two sheets by so much; then they are moved together
_SQUARE_M = 0.8  # from a seam, over which the walls' direction turns into the seam's


@dataclass(frozen=True)
class _Run:
    """Columns of one ring along a wall or a seam; those of an open run end with the first of the next run."""

    columns: np.ndarray
    step_m: float
    sheet: int
    seam: int | None
    is_ring: bool


def lay_sheet_walls(
    free: BaseGeometry, floor: Floor, spacing_m: float, network: DriftNetwork | None = None
) -> WallColumns:
    """Place columns along the walls of each sheet and along its seams, as `lay_walls` does round one sheet.

    Two sheets have the same columns on their seam, and their walls meet there in the direction of the seam.

    Raises
    ------
    GeometryError
        If the walls of two sheets do not meet at their seam.
    """
    seams = seam_lines(floor)
    places: list[np.ndarray] = []
    rings: list[Ring] = []
    runs: list[_Run] = []
    for sheet, part in enumerate(_rounded_sheets(free, floor, seams)):
        for line in (part.exterior, *part.interiors):
            first = sum(ring.count for ring in rings)
            own, xy = _lay_ring(shapely.get_coordinates(line)[:-1], sheet, seams, spacing_m, first)
            rings.append(Ring(first, len(xy), line.length / len(xy), sheet))
            runs += own
            places.append(xy)
    xy = np.concatenate(places)
    offset = floor.offset_m[np.repeat([ring.part for ring in rings], [ring.count for ring in rings])]
    joined, group = _meet(xy, offset, runs)
    is_open = np.zeros(len(xy), bool)
    for run in (run for run in runs if run.seam is not None):
        is_open[run.columns[1:-1]] = True
    walls = np.flatnonzero(~is_open)
    inward = _inward(xy, runs)
    free_m, rock_m, passage_m = np.zeros((3, len(xy)))
    free_m[walls], rock_m[walls] = largest_discs(xy[walls], inward[walls])
    passage_m[walls] = free_m[walls] if network is None else passages(xy[walls], free_m[walls], network)
    free_m, rock_m, passage_m = (_evened(radius, runs) for radius in (free_m, rock_m, passage_m))
    along_m, length_m = _along(len(xy), runs, joined, group)
    sheets = SheetColumns(is_open, joined, group, along_m, length_m, offset)
    return WallColumns(xy, inward, free_m, rock_m, passage_m, rings, sheets, narrowest_half_width(network))


def _rounded_sheets(free: BaseGeometry, floor: Floor, seams: list[SeamLine]) -> list[Polygon]:
    """Return the sheets with rounded corners, rounded together with what is behind their seams and cut there again."""
    parts = shapely.get_parts(shapely.set_precision(free, 0.0))
    rounded = []
    for sheet, whole in enumerate(continue_sheets(free, floor, _BEHIND_M)):
        piece: BaseGeometry = fillet(whole)
        for seam in (seam for seam in seams if sheet in seam.sheets):
            piece = piece.difference(behind_seam(seam.line_in(sheet), parts[sheet], 2 * _BEHIND_M))
        rounded.append(orient(max(shapely.get_parts(piece), key=lambda part: part.area)))
    return rounded


def _lay_ring(
    ring: np.ndarray, sheet: int, seams: list[SeamLine], spacing_m: float, first: int
) -> tuple[list[_Run], np.ndarray]:
    """Return the runs of a ring (k, 2) m, whose columns have numbers from `first`, and the columns' places."""
    seam_of = seams_of_edges(ring, sheet, seams)
    starts = np.flatnonzero(seam_of != np.roll(seam_of, 1))
    if not len(starts):
        line = shapely.LinearRing(ring)
        count = max(8, int(np.ceil(line.length / spacing_m)))
        xy = shapely.get_coordinates(shapely.line_interpolate_point(line, np.arange(count) / count, True))
        return [_Run(first + np.arange(count), line.length / count, sheet, None, True)], xy
    runs, places, laid = [], [], 0
    counts = []
    for start, end in zip(starts, np.roll(starts, -1), strict=True):
        corners = ring[np.arange(start, end + (len(ring) + 1 if end <= start else 1)) % len(ring)]
        length = float(arc_length(corners)[-1])
        # On a seam, both its sheets must have as many columns; the last digits of its length must not decide.
        count = max(2, int(np.ceil(length / spacing_m - 1e-6)))
        line = shapely.LineString(corners)
        places.append(shapely.get_coordinates(shapely.line_interpolate_point(line, np.arange(count) / count, True)))
        counts.append((count, length))
    total = sum(count for count, _ in counts)
    for start, (count, length) in zip(starts, counts, strict=True):
        seam = None if seam_of[start] < 0 else int(seam_of[start])
        runs.append(_Run(first + (laid + np.arange(count + 1)) % total, length / count, sheet, seam, False))
        laid += count
    return runs, np.concatenate(places)


def _meet(xy: np.ndarray, offset_m: np.ndarray, runs: list[_Run]) -> tuple[np.ndarray, np.ndarray]:
    """Move the columns of each seam to one place in both sheets; return the columns on seams (k,) and their groups."""
    pairs = []
    of_seam: dict[int, list[_Run]] = defaultdict(list)
    for run in (run for run in runs if run.seam is not None):
        of_seam[int(run.seam or 0)].append(run)
    for both in of_seam.values():
        if len(both) != 2 or len(both[0].columns) != len(both[1].columns):
            x, y = (xy - offset_m)[both[0].columns].mean(axis=0)
            raise GeometryError(f"surface: the walls of two sheets do not meet at their seam at ({x:.1f}, {y:.1f}) m")
        pairs.append(np.column_stack([both[0].columns, both[1].columns[::-1]]))
    pair = np.concatenate(pairs)
    joined = np.unique(pair)
    links = coo_array((np.ones(len(pair)), np.searchsorted(joined, pair).T), shape=(len(joined), len(joined)))
    _, group = connected_components(links, directed=False)
    place = (xy - offset_m)[joined]
    count = np.bincount(group)
    middle = np.column_stack([np.bincount(group, place[:, k]) / count for k in (0, 1)])[group]
    apart = np.linalg.norm(place - middle, axis=1)
    if apart.max() > _APART_M:
        x, y = place[int(apart.argmax())]
        raise GeometryError(
            f"surface: the walls of two sheets are {2 * apart.max():.2f} m apart at their seam at ({x:.1f}, {y:.1f}) m"
        )
    xy[joined] = middle + offset_m[joined]
    return joined, group


def _inward(xy: np.ndarray, runs: list[_Run]) -> np.ndarray:
    """Return unit vectors (n, 2) to the left of the columns' lines; at the ends of a seam they point along it."""
    inward = np.zeros_like(xy)
    along_seam: dict[int, np.ndarray] = {}
    for run in (run for run in runs if run.seam is not None):
        one, two = run.columns[[0, -1]].tolist()
        ahead = (xy[two] - xy[one]) / np.linalg.norm(xy[two] - xy[one])
        along_seam[one], along_seam[two] = ahead, -ahead
        inward[run.columns[1:-1]] = [-ahead[1], ahead[0]]
    for run in (run for run in runs if run.seam is None):
        line = xy[run.columns]
        along = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0) if run.is_ring else np.gradient(line, axis=0)
        left = np.column_stack([-along[:, 1], along[:, 0]])
        left /= np.linalg.norm(left, axis=1, keepdims=True)
        sigma = min(TURN_M / run.step_m, len(line) / 8)
        smooth = gaussian_filter1d(left, sigma, axis=0, mode="wrap" if run.is_ring else "nearest")
        if not run.is_ring:
            away = arc_length(line)
            for distance, end in ((away, run.columns[0]), (away[-1] - away, run.columns[-1])):
                share = smoothstep(distance / min(_SQUARE_M, away[-1] / 2))[:, None]
                smooth = share * smooth + (1 - share) * along_seam[int(end)]
        inward[run.columns] = smooth / np.linalg.norm(smooth, axis=1, keepdims=True)
    return inward


def _evened(radius: np.ndarray, runs: list[_Run]) -> np.ndarray:
    """Take the minimum over a neighbourhood along each wall, then smooth it over the same neighbourhood."""
    smooth = radius.copy()
    for run in (run for run in runs if run.seam is None):
        mode = "wrap" if run.is_ring else "nearest"
        reach = max(0, min(int(EVEN_M / run.step_m), (len(run.columns) - 1) // 2))
        least = minimum_filter1d(radius[run.columns], 2 * reach + 1, mode=mode)
        smooth[run.columns] = gaussian_filter1d(least, max(reach / 3, 0.1), mode=mode, truncate=3)
    return smooth


def _along(count: int, runs: list[_Run], joined: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far (n,) m columns are along their wall, which goes on behind a seam, and how long (n,) it is."""
    along, length = np.zeros(count), np.ones(count)
    at = dict(zip(joined.tolist(), group.tolist(), strict=True))
    open_runs = [run for run in runs if run.seam is None and not run.is_ring]
    starting = {at[int(run.columns[0])]: run for run in open_runs}
    ending = {at[int(run.columns[-1])] for run in open_runs}
    for run in (run for run in runs if run.is_ring):
        along[run.columns] = np.arange(len(run.columns)) * run.step_m
        length[run.columns] = len(run.columns) * run.step_m
    # Walls whose beginning is no other wall's end come first; what is left over are closed lines.
    for group_number in sorted(starting, key=lambda number: (number in ending, number)):
        chain, number = [], group_number
        while number in starting:
            run = starting.pop(number)
            chain.append(run)
            number = at[int(run.columns[-1])]
        total = 0.0
        for run in chain:
            along[run.columns] = total + np.arange(len(run.columns)) * run.step_m
            total += (len(run.columns) - 1) * run.step_m
        for run in chain:
            length[run.columns] = total
    return along, length
