"""The grid that the visible floor of a volume is made on: points of its facets, and of their borders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets, each_of
from pipeline.mjcf.floor.grid import STATION_M, FloorGrid, widened
from pipeline.params.fittings import FloorParams
from pipeline.volume.mesh_edges import MeshEdges
from pipeline.volume.union import STEEPEST
from pipeline.volume.world.floor.pixels import PixelIndex, pixels_on
from pipeline.volume.world.topology import LegNetwork

LEVEL = 0.005  # rise over run: water on a puddle of 2 m stands 1 cm too high at most
_STEP = 1.5  # spacings of height between neighbours on one floor, besides its steepest slope
_BORDER_M = 0.25  # from a border, of the points that are moved on to it
_DROP_M = 0.1  # a border from which the rock goes down by so much has no bank
_SHORE_M = 2.0  # from the end of a level floor, beyond which its distance does not count
_LEG_M, _FLATTER = 1.0, 0.3  # between a leg and its floor, whose height counts so much less
_LEAST_M2 = 1e-6  # of a face in plan
_AROUND_POINT = 6  # faces, within a grid
_AROUND = np.array([(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy])
_DOWN = 3  # of left, right, up and down


def slopes_of(volume: VolumeFacets) -> np.ndarray:
    """Return the slope (f, 2) of each facet, m a metre to the east and to the north; 0 for a plumb one."""
    up = volume.normals[:, 2:]
    found: np.ndarray = -volume.normals[:, :2] / np.where(up == 0, np.inf, up)
    return found


def volume_grid(params: FloorParams, volume: VolumeFacets, legs: LegNetwork) -> FloorGrid:
    """Return the grid over the floors of a volume, whose last points lie on their borders.

    Parameters
    ----------
    params : FloorParams
    volume : VolumeFacets
    legs : LegNetwork
        Ruts follow those that are flat enough to drive on.
    """
    floors = np.flatnonzero(volume.label == FacetLabel.FLOOR)
    rises = slopes_of(volume)
    corners, rise = volume.vertices[volume.faces[floors]], rises[floors]
    spacing_m = widened(params, 0.0, float(np.abs(volume.normals[floors, 2]).sum() / 2)).spacing_m
    start = np.array([corners[..., 0].min() - 2 * spacing_m, corners[..., 1].max() + 2 * spacing_m])
    facet, pixels = pixels_on(corners[..., :2], start, spacing_m)
    order = np.lexsort(pixels.T)  # neighbours are found several times as fast
    facet, pixels = facet[order], pixels[order]
    places = start + spacing_m * pixels * [1, -1]
    height = corners[facet, 0, 2] + (rise[facet] * (places - corners[facet, 0, :2])).sum(axis=1)
    inner = _FloorPoints(pixels, np.column_stack([places, height]), height, rise[facet])
    borders = _Borders.of(volume)
    grid = inner.joined(_on_borders(inner, borders, spacing_m))
    faces = _faces_between(grid, len(inner.pixels), spacing_m)
    level = np.abs(rises).max(axis=1) <= LEVEL
    return FloorGrid(
        spacing_m,
        grid.pixels,
        grid.points_m,
        grid.rise,
        faces,
        _rim(faces, len(grid.pixels)),
        np.ones(len(grid.pixels), bool),
        _shore_m(grid, borders.between(level), np.abs(grid.rise).max(axis=1) <= LEVEL),
        borders.along(borders.is_end & ~borders.is_brink),
        _under_legs(inner, legs),
        borders.along(borders.is_end & borders.is_brink),
    )


@dataclass(frozen=True)
class _FloorPoints:
    """Points with pixels (n, 2) and places (n, 3) m, the floor's height (n,) m by its plane, and its slope (n, 2)."""

    pixels: np.ndarray
    points_m: np.ndarray
    height_m: np.ndarray
    rise: np.ndarray

    def joined(self, other: _FloorPoints) -> _FloorPoints:
        """Return these points, and then others."""
        names = ("pixels", "points_m", "height_m", "rise")
        return _FloorPoints(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names))

    def step_m(self, spacing_m: float) -> float:
        """Return by how much two neighbours on one floor may differ in height."""
        return _STEP * spacing_m * max(1.0, STEEPEST)


@dataclass(frozen=True)
class _Borders:
    """Edges of floors: ends (e, 2, 3) m, the facets beside and across (e, 2), and whether rock begins there."""

    ends_m: np.ndarray
    facets: np.ndarray
    is_end: np.ndarray
    is_brink: np.ndarray

    @classmethod
    def of(cls, volume: VolumeFacets) -> _Borders:
        """Take the edges of a volume's floors."""
        faces = volume.faces.astype(np.int64)
        edges = MeshEdges(faces, np.arange(len(faces)), volume.label, len(volume.vertices))
        own = np.flatnonzero(volume.label[edges.facet] == FacetLabel.FLOOR)
        across = edges.find(edges.end[own], edges.start[own])
        ends = volume.vertices[np.column_stack([edges.start[own], edges.end[own]])]
        below = ends[..., 2].min(axis=1) - volume.vertices[edges.third[across], 2] > _DROP_M
        facets = np.column_stack([edges.facet[own], edges.facet[across]])
        return cls(ends, facets, edges.is_rim[own], below)

    def along(self, some: np.ndarray) -> np.ndarray:
        """Return points (k, 3) m along some of the edges."""
        return self.sampled(some)[0]

    def sampled(self, some: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return points (k, 3) m along some of the edges, with both ends, and the edge (k,) of each."""
        edges = np.flatnonzero(some)
        a, b = np.moveaxis(self.ends_m[edges], 1, 0)
        pieces = np.ceil(np.linalg.norm(b - a, axis=1) / STATION_M).astype(int)
        edge, step = each_of(pieces + 1)
        share = step / np.maximum(pieces, 1)[edge]
        return a[edge] + share[:, None] * (b - a)[edge], edges[edge]

    def between(self, level: np.ndarray) -> np.ndarray:
        """Return points (k, 3) m where a level floor, of facets (f,), goes on with a slope."""
        return self.along(~self.is_end & level[self.facets[:, 0]] & ~level[self.facets[:, 1]])


def _on_borders(inner: _FloorPoints, borders: _Borders, spacing_m: float) -> _FloorPoints:
    """Return the points beside those on floors, each moved to the nearest place of a border."""
    index, step_m = PixelIndex(inner.pixels, inner.height_m), inner.step_m(spacing_m)
    found = []
    for aside in _AROUND:
        height = inner.height_m + inner.rise @ (aside * [1, -1] * spacing_m)
        new = np.flatnonzero(index.find(inner.pixels + aside, height, step_m) < 0)
        found.append(np.column_stack([inner.pixels[new] + aside, height[new], new]))
    col, row, height, source = np.concatenate(found).T
    order = np.lexsort((height, col, row))
    col, row, height, source = (values[order] for values in (col, row, height, source))
    apart = (np.diff(col) != 0) | (np.diff(row) != 0) | (np.diff(height) > step_m)
    kept = np.append(True, apart)
    pixels, height, source = np.column_stack([col, row])[kept].astype(np.int32), height[kept], source[kept].astype(int)
    middle = inner.points_m[source]
    places = np.column_stack([middle[:, :2] + (pixels - inner.pixels[source]) * [1, -1] * spacing_m, height])
    moved, away_m = _to_borders(places, borders)
    near = away_m <= max(_BORDER_M, 2.5 * spacing_m)
    return _FloorPoints(pixels[near], moved[near], height[near], inner.rise[source[near]])


def _to_borders(places: np.ndarray, borders: _Borders) -> tuple[np.ndarray, np.ndarray]:
    """Return the nearest places (n, 3) m on the ends of floors, and how far (n,) m they are."""
    samples, edge = borders.sampled(borders.is_end)
    ends = borders.ends_m[edge[cKDTree(samples).query(places)[1]]]
    way = ends[:, 1] - ends[:, 0]
    share = ((places - ends[:, 0]) * way).sum(axis=1) / np.maximum((way * way).sum(axis=1), 1e-12)
    moved = ends[:, 0] + np.clip(share, 0.0, 1.0)[:, None] * way
    return moved, np.linalg.norm(moved - places, axis=1)


def _faces_between(grid: _FloorPoints, inner: int, spacing_m: float) -> np.ndarray:
    """Return two faces (f, 3) for each square of four neighbours on one floor.

    Of faces with points on borders, which come after the inner ones, those without an area are left out.
    """
    index, step_m = PixelIndex(grid.pixels, grid.height_m), grid.step_m(spacing_m)

    def beside(some: np.ndarray, aside: tuple[int, int]) -> np.ndarray:
        height = grid.height_m[some] + grid.rise[some] @ (np.array(aside) * [1, -1] * spacing_m)
        found = index.find(grid.pixels[some] + aside, height, step_m)
        return np.where(some < 0, -1, found)

    own = np.arange(len(grid.pixels), dtype=np.int32)
    east, south = beside(own, (1, 0)), beside(own, (0, 1))
    corner = beside(east, (0, 1))
    whole = (east >= 0) & (south >= 0) & (corner >= 0)
    whole[whole] = corner[whole] == beside(south[whole], (1, 0))
    west_north, west_south, east_south, east_north = (k[whole] for k in (own, south, corner, east))
    faces = np.concatenate(
        [
            np.column_stack([west_south, east_south, east_north]),
            np.column_stack([west_south, east_north, west_north]),
        ]
    )
    moved = faces.max(axis=1) >= inner
    a, b, c = np.moveaxis(grid.points_m[faces[moved]][..., :2], 1, 0)
    (x, y), (u, v) = (b - a).T, (c - a).T
    kept = np.ones(len(faces), bool)
    kept[moved] = x * v - y * u > 2 * _LEAST_M2
    return faces if kept.all() else faces[kept]


def _rim(faces: np.ndarray, count: int) -> np.ndarray:
    """Return the edges (r, 2) that one face alone has: between points that have not six faces."""
    at_rim = np.bincount(faces.ravel(), minlength=count) != _AROUND_POINT
    start, end = faces.T.ravel(), np.roll(faces, -1, axis=1).T.ravel()
    both = at_rim[start] & at_rim[end]
    start, end = start[both].astype(np.int64), end[both].astype(np.int64)
    lone = ~np.isin(start * count + end, end * count + start)
    return np.column_stack([start[lone], end[lone]]).astype(np.int32)


def _shore_m(grid: _FloorPoints, ends_m: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Return the distance (n,) m of points on level floors from their ends, -1 on slopes."""
    found = np.full(len(level), -1.0)
    found[level] = cKDTree(ends_m).query(grid.points_m[level], distance_upper_bound=_SHORE_M)[0]
    return found


def _under_legs(grid: _FloorPoints, legs: LegNetwork) -> np.ndarray:
    """Return places (k, 3) m along the legs that are flat enough to drive on, at the height of the floor there."""
    lines = [np.zeros((0, 3))]
    for leg in legs.legs:
        if leg.grade > STEEPEST:
            continue
        ends = np.array([legs.stations_m[leg.start], legs.stations_m[leg.end]])
        ends[:, 2] -= [section[_DOWN] for section in leg.lrud_m]
        count = int(np.ceil(np.linalg.norm(ends[1] - ends[0]) / STATION_M)) + 1
        lines.append(np.linspace(ends[0], ends[1], count))
    places = np.concatenate(lines)
    scale = [1.0, 1.0, _FLATTER]
    away, near = cKDTree(grid.points_m * scale).query(places * scale, distance_upper_bound=_LEG_M)
    found = np.isfinite(away)
    return np.column_stack([places[found, :2], grid.points_m[near[found], 2]])
