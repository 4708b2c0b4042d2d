"""The floors of drivable pieces as one mesh: cells seen from above, and edges of two facets at most."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.volume.height_field.groups import FloorGroups, cells_over
from pipeline.volume.height_field.section_floors import SectionFloors, is_leg
from pipeline.volume.height_field.shared import MEET_M, TOUCH_M, SharedFloors
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.union import Solid

_GRID_M = 1e-7  # of corners: without a grid rounding leaves spikes of no width where outlines meet
_DIGITS = 9  # of corners: on the grid, or between two places on it
_EDGE_M = 1.0  # longest edge of an outline and of a leg
_LEAST_M2 = 1e-12  # of a triangle, twice
_PASSES = 10_000  # pieces in common of two facets that a leg passes over: more than any other two patches have
_SAME = 1_000_000  # pieces in common of two facets of one patch: more than any two patches have


@dataclass(frozen=True)
class FloorSurface:
    """Triangles of the floors, which are sets of pieces that share a floor over a cell.

    Attributes
    ----------
    places : (p, 2) float64, m
    spots : (t, 3) int64
        The place of each corner, counter-clockwise.
    patch : (t,) int64
        Each triangle's patch: the floor that some pieces share over one cell.
    pieces : list of list of int
        Of each patch.
    over : (m, 2) int64
        Patches that lie over each other.
    mates : (k, 2) int64
        Edges that two triangles share; edge 3 t + i begins at corner i of triangle t.
    """

    places: np.ndarray
    spots: np.ndarray
    patch: np.ndarray
    pieces: list[list[int]]
    over: np.ndarray
    mates: np.ndarray

    @cached_property
    def corners(self) -> np.ndarray:
        """Return the vertex (t, 3) of each corner: those that are joined along common edges are one vertex."""
        return weld(len(self.spots), self.mates)

    @cached_property
    def plan_m(self) -> np.ndarray:
        """Return the vertices' places (n, 2) m."""
        found = np.zeros((self.corners.max(initial=-1) + 1, 2))
        found[self.corners] = self.places[self.spots]
        return found

    @cached_property
    def mate(self) -> np.ndarray:
        """Return the edge (3 t,) that each edge is joined with, -1 for the rim."""
        found = np.full(self.spots.size, -1)
        one, two = self.mates.T
        found[one], found[two] = two, one
        return found

    @cached_property
    def rim(self) -> np.ndarray:
        """Return the edges (k,) of one triangle alone."""
        return np.flatnonzero(self.mate < 0)

    @cached_property
    def lines(self) -> tuple[np.ndarray, np.ndarray]:
        """Return a number (3 t,) for each edge's line between two places, and that of the line the other way about."""
        a, b, count = self.spots.ravel(), np.roll(self.spots, -1, axis=1).ravel(), len(self.places)
        return a * count + b, b * count + a

    @cached_property
    def of_pieces(self) -> tuple[np.ndarray, np.ndarray]:
        """Return all pairs of a triangle (n,) and a piece (n,) that has its floor there, sorted by triangle."""
        size = np.array([len(some) for some in self.pieces], int)
        flat = np.array([piece for some in self.pieces for piece in some], int)
        first = np.cumsum(size) - size
        triangle = np.repeat(np.arange(len(self.patch)), size[self.patch])
        start = np.repeat(np.cumsum(size[self.patch]) - size[self.patch], size[self.patch])
        return triangle, flat[np.arange(len(triangle)) - start + first[self.patch[triangle]]]


def weld(count: int, mates: np.ndarray) -> np.ndarray:
    """Return the vertex (count, 3) of each corner of triangles that are joined along their common edges (k, 2).

    Triangles that meet in a corner alone have two vertices there, so that each vertex has one fan of triangles.
    """
    ends = mates - mates % 3 + (mates + 1) % 3
    a, b = np.concatenate([mates[:, 0], ends[:, 0]]), np.concatenate([ends[:, 1], mates[:, 1]])
    n = 3 * count
    found: np.ndarray = connected_components(coo_matrix((np.ones(len(a)), (a, b)), (n, n)), directed=False)[1]
    return found.reshape(-1, 3)


def surface_of(network: SurveyNetwork, pieces: list[Solid], floors: SectionFloors) -> FloorSurface:
    """Return the surface of the floors of all pieces that are flat enough to drive on.

    Seen from above, outlines and legs of a group part the plane into cells. Over each cell the pieces that share a
    floor are one patch, so that the floors of passages over each other are patches of one cell, or of two groups.
    Patches of cells beside each other are joined where they have a piece in common, or where pieces that share a floor
    follow each other.
    """
    shared = SharedFloors(network, pieces, floors)
    lines = _lines(network, pieces, floors)
    for piece, line in shared.level_lines():
        lines[piece].append(line)
    groups = FloorGroups(pieces, floors, shared, lines)
    cells, group = _cells(lines, groups)
    over: list[dict[int, float]] = [{} for _ in cells]
    for cell, piece, z in _floors_over(cells, group, floors, groups.of_piece):
        over[cell][piece] = z
    some = np.flatnonzero([len(found) > 0 for found in over])
    cells, group, over = cells[some], group[some], [over[cell] for cell in some]
    patches = [(cell, some) for cell, found in enumerate(over) for some in _patches(found, shared)]
    cell_of, of_patch = np.array([cell for cell, _ in patches], int), [some for _, some in patches]
    places, triangles, owner = _triangles(cells)
    starts = np.searchsorted(owner, np.arange(len(cells) + 1))
    rows = [np.arange(starts[cell], starts[cell + 1]) for cell in cell_of]
    patch = np.repeat(np.arange(len(rows)), [len(some) for some in rows])
    spots = triangles[np.concatenate([np.zeros(0, int), *rows])]
    ways = _Ways(network, pieces)
    mates = np.array(list(_mates(places, spots, patch, of_patch, shared, floors, ways)), int).reshape(-1, 2)
    return FloorSurface(places, spots, patch, of_patch, _patches_over(cells, group, cell_of), mates)


def _lines(network: SurveyNetwork, pieces: list[Solid], floors: SectionFloors) -> dict[int, list[shapely.Geometry]]:
    """Return what each piece parts floors by: its outline, and the leg."""
    found = {}
    for number, piece in enumerate(pieces):
        if piece.is_drivable:
            leg = [shapely.LineString(network.ways_m[piece.shot][:, :2])] if is_leg(piece) else []
            found[number] = [floors.outlines[number].exterior, *leg]
    return found


def _cells(lines: dict[int, list[shapely.Geometry]], groups: FloorGroups) -> tuple[np.ndarray, np.ndarray]:
    """Return the polygons (n,) between the lines of each group and the group (n,) of each.

    Those beside each other have the same corners: a line that two groups have is parted from the same end.
    """
    found, owner = [], []
    for group, pieces in groups.pieces_by_group().items():
        all_lines = np.array([line for piece in sorted(pieces) for line in lines[piece]], object)
        parts = shapely.get_parts(shapely.node(shapely.union_all(all_lines, grid_size=_GRID_M)))
        parted = shapely.segmentize(shapely.normalize(parts), _EDGE_M)
        found.append(shapely.get_parts(shapely.polygonize(parted)))
        owner += [group] * len(found[-1])
    return np.concatenate([np.zeros(0, object), *found]), np.array(owner, int)


def _floors_over(
    cells: np.ndarray, group: np.ndarray, floors: SectionFloors, of_piece: np.ndarray
) -> Iterator[tuple[int, int, float]]:
    """Yield each cell with each piece of its group that has its floor there, and the height, m."""
    middle = shapely.point_on_surface(cells)
    drivable = np.flatnonzero(of_piece >= 0)
    cell, row = shapely.STRtree(floors.outlines[drivable]).query(middle, predicate="dwithin", distance=TOUCH_M)
    ours = of_piece[drivable[row]] == group[cell]
    cell, piece = cell[ours], drivable[row[ours]]
    height = floors.heights_at(piece, shapely.get_coordinates(middle)[cell])
    yield from zip(cell.tolist(), piece.tolist(), height.tolist(), strict=True)


def _patches_over(cells: np.ndarray, group: np.ndarray, cell_of: np.ndarray) -> np.ndarray:
    """Return the pairs (k, 2) of patches that lie over each other, of one cell (n,) each."""
    first = np.searchsorted(cell_of, np.arange(len(cells) + 1)).tolist()
    both = [(cell, cell) for cell in range(len(cells))] + cells_over(cells, group).tolist()
    found = [(p, q) for a, b in both for p in range(*first[a : a + 2]) for q in range(*first[b : b + 2]) if p < q]
    return np.array(found, int).reshape(-1, 2)


def _patches(heights: dict[int, float], shared: SharedFloors) -> Iterator[list[int]]:
    """Yield the sets of pieces that share a floor at a place, by the pieces' heights there."""
    left = sorted(heights)
    while left:
        found = [left.pop(0)]
        for one in found:
            more = [two for two in left if shared.is_one(one, two, (heights[one], heights[two]))]
            found += more
            left = [two for two in left if two not in more]
        yield sorted(found)


def _triangles(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return places (p, 2) m, triangles (t, 3) of these, counter-clockwise, and the cell (t,) of each, in order."""
    found, owner = shapely.get_parts(shapely.constrained_delaunay_triangles(cells), return_index=True)
    corners = shapely.get_coordinates(shapely.get_exterior_ring(found)).reshape(-1, 4, 2)[:, :3]
    places, spots = np.unique(corners.reshape(-1, 2).round(_DIGITS), axis=0, return_inverse=True)
    spots = spots.reshape(-1, 3)
    a, b, c = np.moveaxis(places[spots], 1, 0)
    double = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    spots[double < 0] = spots[double < 0][:, ::-1]
    good = np.abs(double) > _LEAST_M2
    return places, spots[good], owner[good]


def _mates(
    places: np.ndarray,
    spots: np.ndarray,
    patch: np.ndarray,
    pieces: list[list[int]],
    shared: SharedFloors,
    floors: SectionFloors,
    ways: _Ways,
) -> Iterator[tuple[int, int]]:
    """Yield the pairs of edges that are joined, each edge once: first those of patches with most pieces in common.

    Where a leg passes over an edge its floor goes on, whatever else ends or begins there. Of two other floors that
    part at an edge the lower one goes on, and a wall stands under the other.
    """
    edges: dict[tuple[int, int], list[int]] = defaultdict(list)
    for edge, line in enumerate(zip(spots.ravel().tolist(), np.roll(spots, -1, axis=1).ravel().tolist(), strict=True)):
        edges[line].append(edge)
    several: dict[tuple[int, int], list[tuple[int, int, int]]] = {}  # pieces in common, and both edges, by line
    for (a, b), ours in edges.items():
        tries = []
        for one in ours if a < b else []:
            for two in edges.get((b, a), []):
                p, q = int(patch[one // 3]), int(patch[two // 3])
                tries.append((_SAME if p == q else len(set(pieces[p]) & set(pieces[q])), one, two))
        if len(tries) == 1 and tries[0][0]:
            yield tries[0][1:]
        elif tries:
            several[a, b] = tries
    wanted = [(line, k) for line, tries in several.items() for k in {e // 3 for _, *both in tries for e in both}]
    rows = [(line, k, piece) for line, k in wanted for piece in pieces[patch[k]]]
    middles = places[np.array([line for line, _, _ in rows], int).reshape(-1, 2)].mean(axis=1)
    heights: dict[tuple[tuple[int, int], int], dict[int, float]] = defaultdict(dict)
    found = floors.heights_at(np.array([piece for _, _, piece in rows], int), middles)
    for (line, k, piece), height in zip(rows, found.tolist(), strict=True):
        heights[line, k][piece] = height
    for (line, tries), legs in zip(several.items(), ways.over(places, list(several)), strict=True):
        order = [(ways.in_common(*(pieces[patch[edge // 3]] for edge in both), legs), *both) for _, *both in tries]
        yield from _best(line, order, heights, shared)


class _Ways:
    """The ways of the legs that are flat enough to drive on, seen from above."""

    def __init__(self, network: SurveyNetwork, pieces: list[Solid]) -> None:
        legs = [k for k, piece in enumerate(pieces) if piece.is_drivable and is_leg(piece)]
        self._legs = np.array(legs, int)
        self._tree = shapely.STRtree(shapely.linestrings(network.ways_m[[pieces[k].shot for k in legs], :, :2]))
        self._goes_on = {k for k in legs if network.joined[pieces[k].shot, 1]}

    def over(self, places: np.ndarray, lines: list[tuple[int, int]]) -> list[set[int]]:
        """Return the legs that pass over each line between two places (p, 2) m."""
        found: list[set[int]] = [set() for _ in lines]
        segments = shapely.linestrings(places[np.array(lines, int).reshape(-1, 2)])
        for line, leg in self._tree.query(segments, predicate="dwithin", distance=TOUCH_M).T.tolist():
            found[line].add(int(self._legs[leg]))
        return found

    def in_common(self, one: list[int], two: list[int], legs: set[int]) -> int:
        """Return how many pieces two patches have in common; more than any have if one of the legs passes over both.

        Legs that share a section are one way.
        """
        pairs = [(a, b) for a in one for b in two if a == b or min(a, b) in self._goes_on and abs(a - b) == 1]
        passes = any(a in legs and b in legs for a, b in pairs)
        return sum(a == b for a, b in pairs) + _PASSES * passes


def _best(
    line: tuple[int, int],
    tries: list[tuple[int, int, int]],
    heights: dict[tuple[tuple[int, int], int], dict[int, float]],
    shared: SharedFloors,
) -> Iterator[tuple[int, int]]:
    """Yield the edges of one line that are joined; `heights` are those of the pieces by line and triangle."""
    order = []
    for common, one, two in tries:
        ours, theirs = heights[line, one // 3], heights[line, two // 3]
        if common or _follow(ours, theirs, shared):
            mean = sum(ours.values()) / len(ours) + sum(theirs.values()) / len(theirs)
            order.append((-common, mean, one, two))
    joined: set[int] = set()
    for _, _, one, two in sorted(order):
        if one not in joined and two not in joined:
            joined |= {one, two}
            yield one, two


def _follow(one: dict[int, float], two: dict[int, float], shared: SharedFloors) -> bool:
    """Return whether two of the pieces share a floor, and two are hardly apart in height."""
    near = min(abs(x - y) for x in one.values() for y in two.values()) <= MEET_M
    return near and any(shared.has(i, j) for i in one for j in two)
