"""The floors that the sections state: outlines seen from above, and heights between the sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from pipeline.volume.network import SurveyNetwork
from pipeline.volume.union import Solid

_LEAST_M2 = 1e-4  # of an outline that has an inside
_TURNS = 12  # of Newton's method, which finds a place between two sections
_BEYOND = 0.3  # of the leg's length and width: places are not looked for farther outside
_NO_AREA_M2 = 1e-9
_SPARE_M = 1e-6  # of heights that are only compared


@dataclass(frozen=True)
class SectionFloors:
    """The floors of pieces: a leg's lies between its sections, a hub's is a plane.

    `outlines` are their polygons seen from above (n,), m.
    """

    outlines: np.ndarray
    _talls: np.ndarray  # (n, 2) heights m of the passage over the floors at both ends
    _planes: np.ndarray  # (n, 5) x, y, z m of a place, slope east and north
    _corners: np.ndarray  # (n, 4, 2) m left and right at the start, left and right at the end
    _ends: np.ndarray  # (n, 2) heights m of the floors at both ends
    _between: np.ndarray  # (n,) whether heights are interpolated between the sections

    @classmethod
    def of(cls, network: SurveyNetwork, pieces: list[Solid]) -> SectionFloors:
        """Return the floors of all pieces."""
        outlines = np.array([_outline(piece) for piece in pieces], object)
        talls = np.array([network.lrud_m[piece.shot][:, 2:].sum(axis=1) for piece in pieces])
        planes = np.array([piece.floor for piece in pieces])
        corners, ends, between = np.zeros((len(pieces), 4, 2)), np.zeros((len(pieces), 2)), np.zeros(len(pieces), bool)
        for number, piece in enumerate(pieces):
            if not is_leg(piece):
                talls[number] = piece.sections[0][:, 2].max() - piece.floor[2]
            elif not piece.is_plumb:
                corners[number] = piece.footprint[[0, 3, 1, 2]]
                ends[number] = network.floors_m[piece.shot][:, 2]
                polygon = shapely.Polygon(piece.footprint)
                between[number] = polygon.is_valid and polygon.area > _LEAST_M2
        return cls(outlines, talls, planes, corners, ends, between)

    @property
    def tall_m(self) -> np.ndarray:
        """Return the least height (n,) m of each piece over its floor."""
        least: np.ndarray = self._talls.min(axis=1)
        return least

    @property
    def tallest_m(self) -> float:
        """Return the most height, m, of any piece over its floor."""
        return float(self._talls.max())

    def over(
        self, pieces: np.ndarray, places: np.ndarray, below_m: float, above_m: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the pairs of a place (n, 3) m and one of some pieces whose outline holds it, by their numbers.

        Pieces of other storeys are left out: legs whose floors are nowhere from so far below a place to so far above.
        """
        tree = shapely.STRtree(self.outlines[pieces])
        place, row = tree.query(shapely.points(places[:, :2]), predicate="intersects")
        piece, height = pieces[row], places[place, 2]
        low, high = self._ends.min(axis=1)[piece], self._ends.max(axis=1)[piece]
        near = ~self._between[piece] | ((high >= height - below_m - _SPARE_M) & (low <= height + above_m + _SPARE_M))
        return place[near], piece[near]

    def tall_at(self, pieces: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return the heights (n,) m over the floors of pieces (n,) at places (n, 2) m, one for each."""
        found: np.ndarray = self.tall_m[pieces]
        some = np.flatnonzero(self._between[pieces])
        start, end = self._talls[pieces[some]].T
        found[some] = start + self._along(pieces[some], places[some]) * (end - start)
        return found

    def heights_at(self, pieces: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return the heights (n,) m of the floors of pieces (n,) at places (n, 2) m, one for each."""
        plane = self._planes[pieces]
        found: np.ndarray = plane[:, 2] + np.sum((places - plane[:, :2]) * plane[:, 3:], axis=1)
        some = np.flatnonzero(self._between[pieces])
        share = self._along(pieces[some], places[some])
        start, end = self._ends[pieces[some]].T
        found[some] = start + share * (end - start)
        return found

    def _along(self, pieces: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return how far (n,) from the first section to the second places are: the inverse of a bilinear map."""
        left, right, left_end, right_end = np.moveaxis(self._corners[pieces], 1, 0)
        along, across = np.full(len(pieces), 0.5), np.full(len(pieces), 0.5)
        ways = left_end - left, right_end - right
        for _ in range(_TURNS):
            one, two = left + ways[0] * along[:, None], right + ways[1] * along[:, None]
            ahead, beside = ways[0] * (1 - across)[:, None] + ways[1] * across[:, None], two - one
            off = one + beside * across[:, None] - places
            area = _cross(ahead, beside)
            area = np.where(np.abs(area) < _NO_AREA_M2, _NO_AREA_M2, area)
            along = np.clip(along - _cross(off, beside) / area, -_BEYOND, 1 + _BEYOND)
            across = np.clip(across - _cross(ahead, off) / area, -_BEYOND, 1 + _BEYOND)
        return np.clip(along, 0, 1)


def is_leg(piece: Solid) -> bool:
    """Return whether a piece is a leg; others are prisms on stations."""
    return len(piece.sections) > 1


def _outline(piece: Solid) -> shapely.Polygon:
    """Return the polygon that a piece's floor has; skew sections have that of their hull."""
    polygon = shapely.Polygon(piece.footprint)
    if polygon.is_valid and polygon.area > _LEAST_M2:
        return polygon
    hull = polygon.convex_hull
    return hull if isinstance(hull, shapely.Polygon) else hull.buffer(_LEAST_M2**0.5)


def _cross(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    found: np.ndarray = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    return found
