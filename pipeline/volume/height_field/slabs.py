"""Solids over floors: slabs that are the floors, and what is cut from the passages, so that they end in the slabs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import manifold3d
import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.volume.height_field.heights import HeightField
from pipeline.volume.height_field.overlapping_floors import stations_of
from pipeline.volume.height_field.section_floors import is_leg
from pipeline.volume.height_field.surface import FloorSurface, weld
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.union import Solid

_DEPTH_M = 0.3  # of a slab over its floor, at most half of the passage's height
_PIT_M = 2.0  # farther below: sections of a steep leg are level across, and the floor that it rises from may slope
_SAME_M = 0.01  # between floors of one station
_UNDER_M = 0.1  # below the lowest floor, where what is cut from a passage ends
_SLAB_ASIDE_M, _CUT_ASIDE_M = 3e-7, 6e-7  # beyond the passages' walls: solids that only touch are bad for booleans
_MOST_ASIDE = 3.0  # times that at a corner
_NEAR_M = 1e-5  # between rims of one solid, at least
_ON_SECTION_M = 0.003  # seen from above


@dataclass(frozen=True)
class SlabPart:
    """A mesh: vertices (v, 3) m, facets (f, 3) out of the solid, and the triangle (f,) of the surface under each.

    The first facets are the floor, one for each triangle.
    """

    vertices: np.ndarray
    faces: np.ndarray
    triangle: np.ndarray

    def solid(self) -> manifold3d.Manifold:
        """Return the solid, whose facets are of one number."""
        return _closed(manifold3d.Mesh64(self.vertices, self.faces.astype(np.uint64))).as_original()


def slabs_of(field: HeightField, pieces: list[Solid], keys: dict[int, int]) -> list[manifold3d.Manifold]:
    """Return the slabs over all floors; enter the keys of their facets, `len(FacetLabel) * piece + label`, by number.

    A slab is at least 0.3 m high, or half of the lowest passage on it, over its floor and over the sections'. No part
    of a solid lies over another. Parts have exactly the same wall where they meet, so that their union has none.
    """
    surface = field.surface
    top = np.maximum(field.heights_m, field.high_m) + np.minimum(_DEPTH_M, field.tall_m / 2)
    aside = _SLAB_ASIDE_M * _ways_out(surface.rim, surface.corners, surface.plan_m)
    owner = np.array([next((k for k in some if is_leg(pieces[k])), some[0]) for some in surface.pieces], int)
    part = _parts(surface)[surface.patch]
    found = []
    for number in np.unique(part):
        some = np.flatnonzero(part == number)
        slab = _over(surface, some, surface.plan_m + aside, field.heights_m, top)
        floor = np.arange(len(slab.faces)) < len(some)
        key = len(FacetLabel) * owner[surface.patch[slab.triangle]] + np.where(floor, FacetLabel.FLOOR, FacetLabel.WALL)
        order = np.argsort(key, kind="stable")
        kinds, starts = np.unique(key[order], return_index=True)
        first = manifold3d.Manifold.reserve_ids(len(kinds))
        keys |= {first + n: kind for n, kind in enumerate(kinds.tolist())}
        mesh = manifold3d.Mesh64(
            slab.vertices,
            slab.faces[order].astype(np.uint64),
            run_index=3 * np.append(starts, len(order)),
            run_original_id=first + np.arange(len(kinds)),
        )
        found.append(_closed(mesh))
    return found


class PassageFloors:
    """What is cut from passages: all from below their floors up to half the depth of the slab over these."""

    def __init__(self, network: SurveyNetwork, field: HeightField, pieces: list[Solid], keys: dict[int, int]) -> None:
        """Sort the triangles by the pieces whose floor they are; `keys` get those of cut facets, as in `slabs_of`."""
        self._network, self._surface, self._pieces, self._keys = network, field.surface, pieces, keys
        self._at_station: dict[int, list[int]] = {}
        for number, some in enumerate(stations_of(network, pieces)):
            for station in some if pieces[number].is_drivable else ():
                self._at_station.setdefault(station, []).append(number)
        self._top = field.heights_m + np.minimum(_DEPTH_M, field.tall_m / 2) / 2
        self._bottom = np.minimum(field.heights_m, field.low_m) - _UNDER_M
        triangle, piece = field.surface.of_pieces
        order = np.argsort(piece, kind="stable")
        self._triangles, piece = triangle[order], piece[order]
        self._starts = np.searchsorted(piece, np.arange(len(pieces) + 1))
        self._join(piece)

    def _join(self, piece: np.ndarray) -> None:
        """Join the triangles of each piece (n,) along their common edges: parts, their vertices and their rims.

        All pieces are joined at once: a call for each takes most of its time to begin.
        """
        some, surface = self._triangles, self._surface
        mate, key = surface.mate.reshape(-1, 3)[some], piece * len(surface.spots) + some
        wanted = piece[:, None] * len(surface.spots) + mate // 3
        at = np.minimum(np.searchsorted(key, wanted), max(len(some) - 1, 0))
        self._is_rim = (mate < 0) | (key[at] != wanted)
        own = np.arange(3 * len(some)).reshape(-1, 3)
        mates = np.column_stack([own[~self._is_rim], (3 * at + mate % 3)[~self._is_rim]])
        self._corners, pairs = weld(len(some), mates), mates // 3
        links = coo_matrix((np.ones(len(pairs)), pairs.T), (len(some), len(some)))
        self._part = connected_components(links, directed=False)[1]

    def cut(self, solid: manifold3d.Manifold, numbers: list[int]) -> manifold3d.Manifold:
        """Return the solid of some pieces without what is below their floors' slabs.

        A leg that is too steep to drive on rises out of the floors at its foot: it has nothing below these, either. A
        plumb one stands on the prism of its station, so that what is cut reaches beyond its walls.
        """
        steep = [line for number in numbers for line in self._sections_to_steep(number, set(numbers))]
        stays = shapely.MultiLineString(steep)
        bodies = [body for number in numbers for body in self._bodies(number, stays)]
        if not any(self._pieces[number].is_drivable for number in numbers):
            under = {floor for station, low in self._feet(numbers) for floor in self._floors_at(station, low)}
            aside_m = _CUT_ASIDE_M if any(self._pieces[number].is_plumb for number in numbers) else 0.0
            bodies += [body for floor in sorted(under) for body in self._bodies(floor, stays, _PIT_M, aside_m)]
        return manifold3d.Manifold.batch_boolean([solid, *bodies], manifold3d.OpType.Subtract)

    def _feet(self, numbers: list[int]) -> Iterator[tuple[int, float]]:
        """Yield the stations from which legs rise and no other goes down, and their floors there, m."""
        network, shots = self._network, [self._pieces[number].shot for number in numbers]
        lower = network.floors_m[shots, :, 2].argmin(axis=1)
        heads = set(network.shots[shots, 1 - lower].tolist())
        for shot, end in zip(shots, lower.tolist(), strict=True):
            station = int(network.shots[shot, end])
            if station not in heads:
                yield station, float(network.floors_m[shot, end, 2])

    def _floors_at(self, station: int, low_m: float) -> Iterator[int]:
        """Yield the drivable pieces at a station whose floor there is no higher than that of a leg that rises there."""
        for number in self._at_station.get(station, ()):
            shot = self._pieces[number].shot
            floors = self._network.floors_m[shot, :, 2]
            if floors[self._network.shots[shot] == station].max() < low_m + _SAME_M:
                yield number

    def _sections_to_steep(self, number: int, together: set[int]) -> Iterator[shapely.LineString]:
        """Yield the floors of sections that a leg shares with steep ones of its tube, which begin there."""
        piece = self._pieces[number]
        for other, (left, right) in ((number - 1, (0, 3)), (number + 1, (1, 2))):
            if is_leg(piece) and piece.is_drivable and other in together and not self._pieces[other].is_drivable:
                yield shapely.LineString(piece.footprint[[left, right]])

    def _bodies(
        self, number: int, stays: shapely.MultiLineString, deeper_m: float = 0.0, aside_m: float = _CUT_ASIDE_M
    ) -> Iterator[manifold3d.Manifold]:
        """Yield the solids below the slabs of a piece, which reach beyond its walls but not into steep legs.

        A steep leg goes on beyond the walls. What is cut from it ends within the slab: no rock is left between them.
        """
        rows = np.arange(self._starts[number], self._starts[number + 1])
        surface = self._surface
        ours, back = surface.lines[0].reshape(-1, 3)[self._triangles[rows]].ravel(), surface.lines[1].reshape(-1, 3)
        for kind in np.unique(self._part[rows]):
            some = rows[self._part[rows] == kind]
            part, own = self._triangles[some], np.flatnonzero(self._is_rim[some])
            found, corners = np.unique(self._corners[some], return_inverse=True)
            corners, vertex = corners.reshape(-1, 3), np.zeros(len(found), int)
            vertex[corners] = surface.corners[part]
            places = surface.plan_m[vertex]
            lines = shapely.linestrings(np.stack([places[x.ravel()[own]] for x in (corners, _next(corners))], axis=1))
            out = ~np.isin(back[part].ravel()[own], ours)
            out &= ~shapely.dwithin(shapely.centroid(lines), stays, _ON_SECTION_M)
            aside = aside_m * _ways_out(own[out], corners, places)
            slab = _mesh_over(
                corners, own, part, places + aside, self._bottom[vertex] - deeper_m, self._top[vertex], vertex
            )
            body = slab.solid()
            self._keys[body.original_id()] = len(FacetLabel) * number + FacetLabel.WALL
            yield body


def _next(corners: np.ndarray) -> np.ndarray:
    """Return the corner (t, 3) that follows each in its triangle."""
    return np.roll(corners, -1, axis=1)


def _over(surface: FloorSurface, some: np.ndarray, places: np.ndarray, low: np.ndarray, high: np.ndarray) -> SlabPart:
    """Return the mesh between two heights (n,) over some triangles; the surface's vertices are at places (n, 2)."""
    mates = _mates_within(surface, some)
    corners = weld(len(some), mates)
    vertex = np.zeros(corners.max() + 1, int)
    vertex[corners] = surface.corners[some]
    rim = np.setdiff1d(np.arange(corners.size), mates.ravel())
    return _mesh_over(corners, rim, some, places[vertex], low[vertex], high[vertex], vertex)


def _mesh_over(
    corners: np.ndarray,
    rim: np.ndarray,
    triangle: np.ndarray,
    places: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    vertex: np.ndarray,
) -> SlabPart:
    """Return a floor, a roof, and a plumb wall on each edge of the rim, parted alike from either side."""
    n = len(places)
    a, b = corners.ravel()[rim], _next(corners).ravel()[rim]
    swap = (vertex[a] > vertex[b])[:, None]
    one = np.where(swap, np.column_stack([a, b, a + n]), np.column_stack([a, b, b + n]))
    two = np.where(swap, np.column_stack([b, b + n, a + n]), np.column_stack([a, b + n, a + n]))
    vertices = np.concatenate([np.column_stack([places, low]), np.column_stack([places, high])])
    owner = triangle[rim // 3]
    faces = np.concatenate([corners[:, ::-1], corners + n, one, two])
    return SlabPart(vertices, faces, np.concatenate([triangle, triangle, owner, owner]))


def _ways_out(rim: np.ndarray, corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return for each vertex how it moves (n, 2), seen from above, where edges (k,) of a rim move out by one."""
    a, b = corners.ravel()[rim], _next(corners).ravel()[rim]
    way = places[b] - places[a]
    out = np.column_stack([way[:, 1], -way[:, 0]]) / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    total, count = np.zeros((len(places), 2)), np.zeros(len(places))
    for vertex in (a, b):
        np.add.at(total, vertex, out)
        np.add.at(count, vertex, 1)
    size = np.maximum(np.linalg.norm(total, axis=1), 1e-9)
    return total * np.where(count > 1, np.minimum(2 / size**2, _MOST_ASIDE / size), 1.0)[:, None]


def _mates_within(surface: FloorSurface, some: np.ndarray) -> np.ndarray:
    """Return the common edges (k, 2) of some triangles, whose numbers ascend, by their numbers among these."""
    own = np.arange(3 * len(some))
    edge = 3 * some[own // 3] + own % 3
    mate = surface.mate[edge]
    at = np.minimum(np.searchsorted(some, mate // 3), len(some) - 1)
    within = (mate > edge) & (some[at] == mate // 3)
    return np.column_stack([own, 3 * at + mate % 3])[within]


def _parts(surface: FloorSurface) -> np.ndarray:
    """Return the part (n,) of the slabs that each patch is in: as few as there can be.

    Patches that lie over each other, or whose rims are beside each other, are in different parts.
    """
    apart: list[set[int]] = [set() for _ in surface.pieces]
    for one, two in _apart(surface):
        if one != two:
            apart[one].add(two)
            apart[two].add(one)
    first = list(range(len(apart)))
    within = [{patch} for patch in first]

    def part_of(patch: int) -> int:
        while first[patch] != patch:
            first[patch] = first[first[patch]]
            patch = first[patch]
        return patch

    links = np.unique(np.sort(surface.patch[surface.mates // 3], axis=1), axis=0)
    for one, two in links.tolist():
        a, b = sorted((part_of(one), part_of(two)), key=lambda part: -len(within[part]))
        if a != b and not apart[a] & within[b] and not apart[b] & within[a]:
            first[b] = a
            within[a] |= within[b]
            apart[a] |= apart[b]
    return np.array([part_of(patch) for patch in range(len(first))], int)


def _apart(surface: FloorSurface) -> Iterator[tuple[int, int]]:
    """Yield the pairs of patches that are not in one part."""
    yield from surface.over.tolist()
    rim, (lines, back) = surface.rim, surface.lines
    order = np.argsort(lines, kind="stable")
    low, high = (np.searchsorted(lines[order], back[rim], side) for side in ("left", "right"))
    patch_of = np.repeat(surface.patch, 3)
    for edge, start, end in zip(rim.tolist(), low.tolist(), high.tolist(), strict=True):
        for other in order[start:end].tolist():
            yield int(patch_of[edge]), int(patch_of[other])
    ends = np.column_stack([surface.corners.ravel()[rim], _next(surface.corners).ravel()[rim]])
    segments = shapely.linestrings(surface.plan_m[ends])
    one, two = shapely.STRtree(segments).query(segments, predicate="dwithin", distance=_NEAR_M)
    beside = (one < two) & (ends[one][:, :, None] != ends[two][:, None]).all(axis=(1, 2))
    yield from np.column_stack([patch_of[rim[one[beside]]], patch_of[rim[two[beside]]]]).tolist()


def _closed(mesh: manifold3d.Mesh64) -> manifold3d.Manifold:
    solid = manifold3d.Manifold(mesh)
    if solid.status() != manifold3d.Error.NoError:
        raise ValueError(f"volume: the floors make no closed solid ({solid.status()})")
    return solid
