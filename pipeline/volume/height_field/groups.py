"""Which floors part each other into cells: those far over or under a floor do not, however many storeys a mine has."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.volume.height_field.overlapping_floors import APART_M, TOUCH_M, SharedFloors
from pipeline.volume.height_field.section_floors import SectionFloors, is_leg
from pipeline.volume.union import Solid

_CLEAR_M = 0.01  # seen from above: what is farther from a section has no corner on it
_OVERLAP_M2 = 1e-6  # of two legs, or two cells, that only touch
_SAME_M = 1e-9

_Pair = tuple[int, int]


class FloorGroups:
    """Groups of drivable pieces that are parted into cells together.

    Pieces that touch seen from above and are near in height have one group. A passage is parted at a section between
    two legs where nothing else of either group is: both groups have the same corners there. `of_piece` (n,) is the
    number of each piece's group, -1 where it is too steep to drive on.
    """

    def __init__(
        self, pieces: list[Solid], floors: SectionFloors, shared: SharedFloors, lines: dict[int, list[shapely.Geometry]]
    ) -> None:
        """Find the groups; `lines` are what each drivable piece parts floors by."""
        self._drivable = np.array(sorted(lines), int)
        pairs = list(_near_pairs(pieces, floors, shared, self._drivable))
        sections = {pair: line for pair in pairs if (line := _section(pieces, floors, *pair)) is not None}
        beside = _beside(sections, lines)
        self.of_piece = self._components(len(pieces), pairs, sections)
        self._sections = sections
        while blocked := self._blocked(beside):
            for pair in blocked:
                del sections[pair]
            self.of_piece = self._components(len(pieces), pairs, sections)

    def pieces_by_group(self) -> dict[int, set[int]]:
        """Return the pieces by whose lines each group is parted: its own, and those behind its open sections."""
        found: dict[int, set[int]] = {}
        for piece in self._drivable.tolist():
            found.setdefault(int(self.of_piece[piece]), set()).add(piece)
        for one, two in self._sections:
            found[int(self.of_piece[one])].add(two)
            found[int(self.of_piece[two])].add(one)
        return found

    def _components(self, count: int, pairs: list[_Pair], sections: dict[_Pair, shapely.LineString]) -> np.ndarray:
        kept = np.array([pair for pair in pairs if pair not in sections], int).reshape(-1, 2)
        group = connected_components(coo_matrix((np.ones(len(kept)), kept.T), (count, count)), directed=False)[1]
        found = np.full(count, -1)
        found[self._drivable] = group[self._drivable]
        return found

    def _blocked(self, beside: dict[_Pair, set[int]]) -> list[_Pair]:
        """Return the sections at which a third piece parts one of the groups, or that part no groups."""
        by_group, found = self.pieces_by_group(), []
        for pair in self._sections:
            one, two = (int(self.of_piece[k]) for k in pair)
            if one == two or beside[pair] & (by_group[one] | by_group[two]):
                found.append(pair)
        return found


def cells_over(cells: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Return the pairs (k, 2) of cells of different groups (n,) that lie over each other seen from above."""
    one, two = shapely.STRtree(cells).query(cells, predicate="intersects")
    other = (one < two) & (group[one] != group[two])
    one, two = one[other], two[other]
    some = shapely.area(shapely.intersection(cells[one], cells[two])) > _OVERLAP_M2
    found: np.ndarray = np.column_stack([one[some], two[some]])
    return found


def _near_pairs(
    pieces: list[Solid], floors: SectionFloors, shared: SharedFloors, drivable: np.ndarray
) -> Iterator[_Pair]:
    """Yield the pairs that touch seen from above and share a floor or are near in height."""
    size = np.array([len(pieces[k].footprint) for k in drivable], int)
    places = np.concatenate([np.zeros((0, 2)), *(pieces[k].footprint[:, :2] for k in drivable)])
    height = floors.heights_at(np.repeat(drivable, size), places)
    starts = np.cumsum(size) - size
    low, high = (f.reduceat(height, starts) if len(size) else height for f in (np.minimum, np.maximum))
    outlines = floors.outlines[drivable]
    one, two = shapely.STRtree(outlines).query(outlines, predicate="dwithin", distance=TOUCH_M)
    near = np.maximum(low[one], low[two]) - np.minimum(high[one], high[two]) < APART_M
    for a, b, is_near in zip(drivable[one].tolist(), drivable[two].tolist(), near.tolist(), strict=True):
        if a < b and (is_near or shared.has(a, b)):
            yield a, b


def _section(pieces: list[Solid], floors: SectionFloors, one: int, two: int) -> shapely.LineString | None:
    """Return the floor of the section that two legs of one tube share, unless they overlap elsewhere."""
    if two != one + 1 or not (is_leg(pieces[one]) and is_leg(pieces[two])):
        return None
    ends, starts = pieces[one].footprint[[1, 2]], pieces[two].footprint[[0, 3]]
    if np.abs(ends - starts).max() > _SAME_M:
        return None
    overlap = shapely.intersection(floors.outlines[one], floors.outlines[two]).area
    return shapely.LineString(ends) if overlap < _OVERLAP_M2 else None


def _beside(
    sections: dict[_Pair, shapely.LineString], lines: dict[int, list[shapely.Geometry]]
) -> dict[_Pair, set[int]]:
    """Return the pieces with a line at each section, but the two that share it."""
    owner = [piece for piece, some in lines.items() for _ in some]
    tree = shapely.STRtree([line for some in lines.values() for line in some])
    found = {pair: set[int]() for pair in sections}
    pairs = list(sections)
    near = tree.query(np.array(list(sections.values()), object), predicate="dwithin", distance=_CLEAR_M)
    for section, line in near.T.tolist():
        if owner[line] not in pairs[section]:
            found[pairs[section]].add(owner[line])
    return found
