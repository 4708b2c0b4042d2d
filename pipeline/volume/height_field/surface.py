"""The floors of drivable pieces as one mesh: cells seen from above, and edges of two facets at most."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.volume.height_field.edges import LegWays, joined_edges
from pipeline.volume.height_field.groups import FloorGroups, cells_over
from pipeline.volume.height_field.overlapping_floors import TOUCH_M, Descents, SharedFloors
from pipeline.volume.height_field.section_floors import SectionFloors, is_leg
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.union import STEEPEST, Solid

_GRID_M = 1e-7  # of corners: without a grid rounding leaves spikes of no width where outlines meet
_DIGITS = 9  # of corners: on the grid, or between two places on it
_EDGE_M = 1.0  # longest edge of an outline and of a leg
_RAMP_DIGITS = 3  # of lengths, m, at which a leg that comes down has corners
_LEAST_RAMP_M = 0.02  # along a leg that passes over another
_LEAST_M2 = 1e-12  # of a triangle, twice


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
    parted : (n,) bool
        Of each patch, whether another one lies over or under it with which it is one floor elsewhere.
    held : (n,) bool
        Of each patch, whether one lies over or under it that it hardly does not meet.
    mates : (k, 2) int64
        Edges that two triangles share; edge 3 t + i begins at corner i of triangle t.
    """

    places: np.ndarray
    spots: np.ndarray
    patch: np.ndarray
    pieces: list[list[int]]
    over: np.ndarray
    parted: np.ndarray
    held: np.ndarray
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


def surface_of(
    network: SurveyNetwork, pieces: list[Solid], floors: SectionFloors, shared: SharedFloors
) -> FloorSurface:
    """Return the surface of the floors of all pieces that are flat enough to drive on.

    Seen from above, outlines and legs of a group part the plane into cells. Over each cell the pieces that share a
    floor are one patch, so that the floors of passages over each other are patches of one cell, or of two groups.
    Patches of cells beside each other are joined where they have a piece in common, or where pieces that share a floor
    follow each other.
    """
    lines = _lines(network, pieces, floors, shared)
    groups = FloorGroups(pieces, floors, shared, lines)
    cells, group = _cells(lines, groups)
    over = _pieces_over(cells, group, floors, groups.of_piece)
    some = np.flatnonzero([len(found) > 0 for found in over])
    cells, group, over = cells[some], group[some], [over[cell] for cell in some]
    patches = [(cell, some) for cell, found in enumerate(_patches(cells, over, shared)) for some in found]
    cell_of, of_patch = np.array([cell for cell, _ in patches], int), [some for _, some in patches]
    places, triangles, owner = _triangles(cells)
    starts = np.searchsorted(owner, np.arange(len(cells) + 1))
    rows = [np.arange(starts[cell], starts[cell + 1]) for cell in cell_of]
    patch = np.repeat(np.arange(len(rows)), [len(some) for some in rows])
    spots = triangles[np.concatenate([np.zeros(0, int), *rows])]
    ways = LegWays(network, pieces)
    mates = np.array(list(joined_edges(places, spots, patch, of_patch, shared, floors, ways)), int).reshape(-1, 2)
    patches_over = _patches_over(cells, group, cell_of)
    parted, held = (_over_one(patches_over, of_patch, of) for of in (shared.has, shared.nearly))
    return FloorSurface(places, spots, patch, of_patch, patches_over, parted, held, mates)


def _lines(
    network: SurveyNetwork, pieces: list[Solid], floors: SectionFloors, shared: SharedFloors
) -> dict[int, list[shapely.Geometry]]:
    """Return what each piece parts floors by: its outline, the leg, and where floors that it shares begin to be two."""
    found = {k: [floors.outlines[k].exterior] for k, piece in enumerate(pieces) if piece.is_drivable}
    ways = shapely.linestrings(network.ways_m[[piece.shot for piece in pieces]][:, :, :2])
    ramps = _ramps(ways, shared.descents)
    for leg in found:
        if is_leg(pieces[leg]):
            way = ways[leg]
            beside = [at for at in ramps.get(leg, ()) if _LEAST_RAMP_M < at < way.length - _LEAST_RAMP_M]
            corners = shapely.line_interpolate_point(way, [0.0, *beside, way.length])
            found[leg].append(shapely.LineString(corners))
    for piece, line in shared.borders():
        found[piece].append(line)
    return found


def _ramps(ways: np.ndarray, descents: Descents) -> dict[int, np.ndarray]:
    """Return the lengths, m, along ways (n,) of legs at which they have a corner, by leg.

    A corner is where a descent ends, and where two meet.
    """
    along = shapely.line_locate_point(ways[descents.legs], shapely.points(descents.places))
    ramp = descents.over_m / STEEPEST
    found = {}
    for leg in np.unique(descents.legs).tolist():
        at, half = along[descents.legs == leg], ramp[descents.legs == leg]
        low, high = at - half, at + half
        two = (at[:, None] < at) & (high[:, None] > low)
        found[leg] = np.unique(np.concatenate([low, high, ((high[:, None] + low) / 2)[two]]).round(_RAMP_DIGITS))
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


def _pieces_over(cells: np.ndarray, group: np.ndarray, floors: SectionFloors, of_piece: np.ndarray) -> list[list[int]]:
    """Return the pieces of each cell's group that have their floor there."""
    found: list[list[int]] = [[] for _ in cells]
    drivable = np.flatnonzero(of_piece >= 0)
    tree = shapely.STRtree(floors.outlines[drivable])
    cell, row = tree.query(shapely.point_on_surface(cells), predicate="dwithin", distance=TOUCH_M)
    ours = of_piece[drivable[row]] == group[cell]
    for k, piece in zip(cell[ours].tolist(), drivable[row[ours]].tolist(), strict=True):
        found[k].append(piece)
    return found


def _patches_over(cells: np.ndarray, group: np.ndarray, cell_of: np.ndarray) -> np.ndarray:
    """Return the pairs (k, 2) of patches that lie over each other, of one cell (n,) each."""
    first = np.searchsorted(cell_of, np.arange(len(cells) + 1)).tolist()
    both = [(cell, cell) for cell in range(len(cells))] + cells_over(cells, group).tolist()
    found = [(p, q) for a, b in both for p in range(*first[a : a + 2]) for q in range(*first[b : b + 2]) if p < q]
    return np.array(found, int).reshape(-1, 2)


def _over_one(over: np.ndarray, pieces: list[list[int]], holds: Callable[[int, int], bool]) -> np.ndarray:
    """Return which patches (n,) are over or under (k, 2) another where that holds for a piece of both."""
    found = np.zeros(len(pieces), bool)
    for p, q in over.tolist():
        if any(holds(one, two) for one in pieces[p] for two in pieces[q]):
            found[[p, q]] = True
    return found


def _patches(cells: np.ndarray, over: list[list[int]], shared: SharedFloors) -> Iterator[list[list[int]]]:
    """Yield for each cell the sets of its pieces that share a floor there."""
    pairs = [(cell, a, b) for cell, some in enumerate(over) for a in some for b in some if a < b and shared.has(a, b)]
    rows = np.array(pairs, int).reshape(-1, 3)
    middles = shapely.get_coordinates(shapely.point_on_surface(cells))
    is_one = shared.is_one(rows[:, 1], rows[:, 2], middles[rows[:, 0]])
    linked = {pair for pair, holds in zip(pairs, is_one.tolist(), strict=True) if holds}
    for cell, some in enumerate(over):
        left, patches = sorted(some), []
        while left:
            found = [left.pop(0)]
            for one in found:
                found += [two for two in left if (cell, min(one, two), max(one, two)) in linked]
                left = [two for two in left if two not in found]
            patches.append(sorted(found))
        yield patches


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
