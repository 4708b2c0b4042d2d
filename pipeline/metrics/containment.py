"""Whether collision walls enclose the workings: exact comparison of slices of the convex parts with the free space."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.floors.floor import Floor

STRIP_M = 0.5  # of rock beside every wall of a mine with heights
_NOTHING_M2 = 1e-7
_ROUND_M = 1e-4
_SEAM_M = 0.002  # edges of neighbouring parts may differ by the rounding of decimals in the MJCF


@dataclass(frozen=True)
class WallCover:
    """Worst values over all heights: rock in the free space, m2; missing rock, m2; the widest gap along a wall, m."""

    intrusion_m2: float
    missing_m2: float
    widest_gap_m: float


def cover_walls(parts: Iterable[np.ndarray], free: Polygon, world: Polygon, heights_m: Iterable[float]) -> WallCover:
    """Compare slices of convex parts with the rock that the plan leaves.

    Parameters
    ----------
    parts : iterable of (n, 3) float64, m, mine frame
        Vertices of convex parts, in any order.
    free, world : shapely.Polygon, m, mine frame
        The workings, and the box that rock and workings fill together.
    heights_m : iterable of float
        Heights of the slices.
    """
    all_parts = list(parts)
    worst = [0.0, 0.0, 0.0]
    for height in heights_m:
        rock = shapely.union_all([_slice(part, height) for part in all_parts])
        uncovered = free.boundary.intersection(world.buffer(-_SEAM_M)).difference(rock.buffer(_SEAM_M))
        gaps = (
            [piece.length for piece in shapely.get_parts(shapely.line_merge(uncovered))]
            if not uncovered.is_empty
            else [0.0]
        )
        errors = (rock.intersection(free).area, world.difference(free).difference(rock).area, max(gaps))
        worst = [max(a, b) for a, b in zip(worst, errors, strict=True)]
    return WallCover(*(round(float(v), 6) for v in worst))


def cover_floor(
    parts: Iterable[np.ndarray], floor: Floor, heights_m: Iterable[float], no_walls: BaseGeometry | None = None
) -> WallCover:
    """Compare slices of convex parts with the rock round a floor with heights, triangle by triangle.

    Relative to the plane of a triangle, which is a shear, a slice at a constant height above it is exact. No part may
    stand over a triangle; beside its edges on the boundary a strip of `STRIP_M` must be rock.

    Parameters
    ----------
    parts : iterable of (n, 3) float64, m, mine frame
    floor : Floor
    heights_m : iterable of float
        Heights of the slices above the floor in the plan; a stretched one is stretched with it, and stays a plane.
    no_walls : shapely geometry, m, plan
        Edges on the boundary along these lines have no walls.
    """
    all_parts, heights = list(parts), list(heights_m)
    footprints = [shapely.convex_hull(shapely.multipoints(part[:, :2])) for part in all_parts]
    tree, spans = shapely.STRtree(footprints), np.array([(part[:, 2].min(), part[:, 2].max()) for part in all_parts])
    places = floor.vertices[:, :2][floor.faces] - floor.offset_m[floor.sheet][:, None]
    triangles = shapely.polygons(places)
    own = np.stack([_shifted_planes(floor.raised(height)) for height in heights], axis=1)
    levels, tops = floor.vertices[:, 2][floor.faces], floor.raised(max(heights)).vertices[:, 2][floor.faces]
    intrusion = np.zeros(len(heights))
    for face, part in zip(*tree.query(triangles, predicate="intersects"), strict=True):
        beside = spans[part, 1] < levels[face].min() or spans[part, 0] > tops[face].max()
        if beside or shapely.intersection(triangles[face], footprints[part]).area < _NOTHING_M2:
            continue
        for k, cut in enumerate(_slices_along(all_parts[part], own[face])):
            intrusion[k] += shapely.intersection(cut, triangles[face]).area
    missing = np.zeros(len(heights))
    gaps: list[list[BaseGeometry]] = [[] for _ in heights]
    for face, edge, strip in _strips(floor, triangles, levels, tops, no_walls or Polygon()):
        near = [part for part in tree.query(strip) if spans[part, 1] > levels[face].min()]
        cuts = [_slices_along(all_parts[part], own[face]) for part in near]
        for k in range(len(heights)):
            rock = shapely.union_all([cut[k] for cut in cuts])
            missing[k] += strip.difference(rock).area
            gaps[k].append(edge.difference(rock.buffer(_SEAM_M)))
    widest = [
        max((g.length for g in shapely.get_parts(shapely.line_merge(shapely.union_all(of)))), default=0.0)
        for of in gaps
    ]
    return WallCover(*(round(float(max(v)), 6) for v in (intrusion, missing, widest)))


def _shifted_planes(floor: Floor) -> np.ndarray:
    """Return the planes (m, 3) of the faces in the mine frame."""
    planes = floor.planes.copy()
    planes[:, 2] += (planes[:, :2] * floor.offset_m[floor.sheet]).sum(axis=1)
    return planes


def _slices_along(part: np.ndarray, planes: np.ndarray) -> list[BaseGeometry]:
    """Return the slices of a convex body along planes (k, 3), seen from above."""
    above = part[:, 2] - planes[:, :2] @ part[:, :2].T - planes[:, 2:]
    return [_slice(np.column_stack([part[:, :2], heights]), 0.0) for heights in above]


def slices_above(part: np.ndarray, plane: np.ndarray, heights_m: list[float]) -> list[BaseGeometry]:
    """Return the slices of a convex body at heights above a plane, seen from above."""
    sheared = np.column_stack([part[:, :2], part[:, 2] - part[:, :2] @ plane[:2] - plane[2]])
    return [_slice(sheared, height) for height in heights_m]


def _strips(
    floor: Floor, triangles: np.ndarray, levels: np.ndarray, tops: np.ndarray, no_walls: BaseGeometry
) -> Iterator[tuple[int, BaseGeometry, BaseGeometry]]:
    """Return for each edge on a wall its face, the edge, and the strip of rock beside it, in the mine frame."""
    tree = shapely.STRtree(triangles)
    for face, (a, b) in floor.wall_edges():
        if no_walls.covers(shapely.points(floor.vertices[[a, b], :2])).all():
            continue
        edge = floor.vertices[[a, b], :2] - floor.offset_m[floor.sheet[face]]
        along = edge[1] - edge[0]
        out = np.array([along[1], -along[0]]) / max(float(np.hypot(*along)), 1e-12) * STRIP_M
        strip = shapely.Polygon([edge[0], edge[0] + out, edge[1] + out, edge[1]])
        near = tree.query(strip, predicate="intersects")
        same = (levels[near].min(axis=1) < tops[face].max()) & (tops[near].max(axis=1) > levels[face].min())
        # Floor a little above or below is workings too; its own edges judge the rock beside it.
        yield (
            face,
            shapely.LineString(edge),
            strip.difference(shapely.union_all(triangles[near[same]]).buffer(_ROUND_M)),
        )


def _slice(part: np.ndarray, height_m: float) -> BaseGeometry:
    """Return the horizontal slice of a convex body: the hull of the crossings of all segments between its vertices."""
    below, above = part[part[:, 2] <= height_m], part[part[:, 2] > height_m]
    if not len(below) or not len(above):
        return Polygon()
    rise = (height_m - below[:, None, 2]) / (above[None, :, 2] - below[:, None, 2])
    crossing = below[:, None, :2] + rise[..., None] * (above[None, :, :2] - below[:, None, :2])
    return shapely.convex_hull(shapely.multipoints(crossing.reshape(-1, 2)))


def open_area_m2(slabs: Iterable[tuple[float, float, float, float]], free: Polygon) -> float:
    """Return the area of free space, m2, that no slab covers in plan; slabs are (west, south, east, north), m."""
    return round(float(free.difference(shapely.union_all([shapely.box(*slab) for slab in slabs])).area), 6)
