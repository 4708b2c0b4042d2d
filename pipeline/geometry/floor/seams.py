"""Seams: the lines in plan along which sheets were cut from each other; there is open air, and no wall."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from minexplore.floors.floor import Floor

_SNAP_M = 1e-6  # two sheets differ by rounding where they meet
_ON_SEAM_M = 1e-4
_ASIDE_M = 0.3  # of a seam's ends: rounded corners may lie there


@dataclass(frozen=True)
class SeamLine:
    """A seam between two sheets: its straight line (2, 2) m in the plan of each."""

    sheets: tuple[int, int]
    lines_m: np.ndarray

    def line_in(self, sheet: int) -> np.ndarray:
        """Return the line (2, 2) m in the plan of one of its sheets."""
        line: np.ndarray = self.lines_m[self.sheets.index(sheet)]
        return line


def seam_lines(floor: Floor) -> list[SeamLine]:
    """Return the seams of a floor; a floor of one sheet has none."""
    if len(floor.offset_m) == 1:
        return []
    (edges, beyond), sheet = floor.edges, np.tile(floor.sheet, 3)
    found: dict[tuple[int, int], list[np.ndarray]] = defaultdict(list)
    for k in np.flatnonzero((beyond >= 0) & (sheet[beyond] > sheet)).tolist():
        found[int(sheet[k]), int(sheet[beyond[k]])].append(floor.vertices[edges[k], :2])
    seams = []
    for (one, two), pieces in sorted(found.items()):
        merged = shapely.line_merge(shapely.multilinestrings(np.array(pieces)))
        for line in shapely.get_parts(merged):
            ends = shapely.get_coordinates(line)[[0, -1]]
            seams.append(SeamLine((one, two), np.stack([ends, ends - floor.offset_m[one] + floor.offset_m[two]])))
    return seams


def continue_sheets(free: BaseGeometry, floor: Floor, reach_m: float) -> list[Polygon]:
    """Return each sheet with the workings behind its seams, so far as they lie within `reach_m` of them."""
    parts = list(shapely.get_parts(shapely.set_precision(free, 0.0)))
    seams = seam_lines(floor)
    continued = []
    for sheet, part in enumerate(parts):
        pieces = [part]
        for seam in (seam for seam in seams if sheet in seam.sheets):
            other = seam.sheets[1 - seam.sheets.index(sheet)]
            line = shapely.LineString(seam.line_in(sheet))
            moved = translate(parts[other], *(floor.offset_m[sheet] - floor.offset_m[other]))
            near = shapely.get_parts(moved.intersection(line.buffer(reach_m)))
            pieces += [piece for piece in near if piece.distance(line) < _SNAP_M and piece.area > 0]
        whole = shapely.union_all(pieces, grid_size=_SNAP_M) if len(pieces) > 1 else part
        continued.append(max(shapely.get_parts(whole), key=lambda piece: piece.area))
    return continued


def behind_seam(line_m: np.ndarray, inside: Polygon, depth_m: float, aside_m: float = _ASIDE_M) -> Polygon:
    """Return the box behind a seam (2, 2) m, as seen from its sheet, a little wider than the seam."""
    along = (line_m[1] - line_m[0]) / np.linalg.norm(line_m[1] - line_m[0])
    across = np.array([-along[1], along[0]])
    probe = line_m.mean(axis=0) + 1e-3 * across
    if inside.contains(shapely.Point(probe)):
        across = -across
    one, two = line_m[0] - aside_m * along, line_m[1] + aside_m * along
    return Polygon([one, two, two + depth_m * across, one + depth_m * across])
