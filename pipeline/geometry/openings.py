"""Openings in plan: where a shaft fits into its drift, and the workings and the floor's mesh with and without them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.floor import Floor
from pipeline.geometry.partition import triangulate
from pipeline.geometry.wall_foot import boundary_rings
from pipeline.types import Heights, Opening, Openings, Shaft

_SIDES_M, _WIDEST_M = (1.5, 1.0), 6.0  # of a collar, tried after the surveyed width; the least lets a robot fall in
_FROM_WALL_M = 0.1
_PASSAGE_M = 0.9  # a robot of 0.7 m passes
_POCKET_M2 = 6.0  # of places for a robot's middle that an opening may cut off, at a dead end
_FROM_SEAM_M = 2.0
_AROUND_M = 15.0  # of a shaft that are looked at
_BESIDE_M = 0.05  # faces so near to an opening are cut anew, so that none is a sliver
_DIGITS = 4

Seams = list[BaseGeometry]


def fit_openings(outline: BaseGeometry, heights: Heights) -> tuple[Openings, list[str]]:
    """Return the openings that fit into the workings, and a line for each shaft that does not.

    A collar is a square along its drift, as wide as surveyed if it fits, else 1.5 or 1 m. It fits if rock is all round
    it, if a robot passes beside it or the drift ends behind it, and if the shaft meets the roof of the drift below.

    Parameters
    ----------
    outline : shapely polygon, one a sheet, m, plan
    heights : Heights
    """
    parts = shapely.get_parts(outline)
    seams = [
        shapely.LineString(np.array(seam.ends_m) + heights.offset_m[k]) for seam in heights.seams for k in seam.sheets
    ]
    built: list[Opening] = []
    left_out = []
    for shaft in heights.shafts:
        sides = dict.fromkeys((*([min(shaft.side_m, _WIDEST_M)] if shaft.side_m else []), *_SIDES_M))
        part = _cut(parts[shaft.sheet], [o for o in built if o.sheet == shaft.sheet])
        aside = None
        if shaft.below is not None:
            aside = np.array(heights.offset_m[shaft.below]) - heights.offset_m[shaft.sheet]
        for side in sides:
            corners = _square(shaft, side)
            is_over = aside is None or _is_over(parts[shaft.below], Polygon(corners + aside), seams)
            if is_over and _fits(part, Polygon(corners), seams):
                ring = tuple((float(x), float(y)) for x, y in corners)
                built.append(Opening(ring, shaft.sheet, shaft.below, shaft.top_m, shaft.bottom_m))
                break
        else:
            (x, y), (top, bottom) = shaft.place_m, shaft.stations
            left_out.append(
                f"the shaft from {top} to {bottom} at ({x:.1f}, {y:.1f}) is left out: {min(sides):g} m wide, it has no "
                f"{_PASSAGE_M:g} m of drift beside it, is within {_FROM_SEAM_M:g} m of a seam of two sheets, or misses "
                "the drift below"
            )
    return Openings(built), left_out


def _square(shaft: Shaft, side_m: float) -> np.ndarray:
    """Return the corners (4, 2) m of a collar, counter-clockwise, in plan."""
    c, s = np.cos(shaft.heading_rad), np.sin(shaft.heading_rad)
    corners = side_m / 2 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return np.asarray((corners @ np.array([(c, s), (-s, c)]) + shaft.place_m).round(_DIGITS))


def _fits(part: Polygon, collar: Polygon, seams: Seams) -> bool:
    """Return whether a collar lies in a sheet, and the drift beside it stays passable or ends behind it."""
    near = part.intersection(collar.centroid.buffer(_AROUND_M))
    if not near.buffer(-_FROM_WALL_M).contains(collar) or min(map(collar.distance, seams), default=np.inf) < (
        _FROM_SEAM_M
    ):
        return False
    before = shapely.get_parts(near.buffer(-_PASSAGE_M / 2))
    after = shapely.get_parts(near.difference(collar).buffer(-_PASSAGE_M / 2))
    for whole in before:
        pieces = sorted((piece for piece in after if piece.intersects(whole)), key=lambda piece: -piece.area)
        for pocket in pieces[1:]:
            if pocket.area > _POCKET_M2 or min(map(pocket.distance, seams), default=np.inf) < _PASSAGE_M:
                return False
    return True


def _is_over(below: Polygon, section: Polygon, seams: Seams) -> bool:
    """Return whether a shaft meets the roof of the sheet below, off its walls and seams."""
    return bool(below.contains(section.buffer(_FROM_WALL_M))) and all(
        seam.distance(section) > _FROM_WALL_M for seam in seams
    )


def polygon_of_opening(opening: Opening) -> Polygon:
    """Return an opening in plan."""
    return Polygon(opening.outline_m)


def cut_openings(outline: BaseGeometry, openings: Openings) -> BaseGeometry:
    """Return the workings with openings as islands; all other corners stay."""
    parts = [
        _cut(part, [o for o in openings.shafts if part.contains(polygon_of_opening(o))])
        for part in shapely.get_parts(outline)
    ]
    return parts[0] if isinstance(outline, Polygon) else MultiPolygon(parts)


def _cut(part: Polygon, openings: Sequence[Opening]) -> Polygon:
    return Polygon(part.exterior, [*part.interiors, *(o.outline_m for o in openings)]) if openings else part


def without_openings(outline: BaseGeometry, openings: Openings) -> BaseGeometry:
    """Return the workings as if openings were floor: the network of drifts is that of these."""
    if not openings.shafts:
        return outline
    rings = {frozenset(opening.outline_m) for opening in openings.shafts}
    parts = [
        Polygon(part.exterior, [ring for ring in part.interiors if frozenset(ring.coords) not in rings])
        for part in shapely.get_parts(outline)
    ]
    return parts[0] if isinstance(outline, Polygon) else MultiPolygon(parts)


def filled_floor(floor: Floor, openings: Openings) -> Floor:
    """Return a floor that `cut_floor` made with faces over its openings: visible rock is made over it."""
    return floor.filled(np.array(opening.outline_m) for opening in openings.shafts)


def cut_floor(floor: Floor, openings: Openings) -> Floor:
    """Return a floor without its faces over openings.

    The faces about an opening are triangulated anew, with the opening's corners at the height that the floor has there.
    """
    for opening in openings.shafts:
        floor = _without_faces(floor, opening)
    return floor


def _without_faces(floor: Floor, opening: Opening) -> Floor:
    corners = np.array(opening.outline_m)
    triangles = shapely.polygons(floor.vertices[floor.faces, :2])
    near = shapely.intersects(triangles, polygon_of_opening(opening).buffer(_BESIDE_M)) & (floor.sheet == opening.sheet)
    rings = [floor.vertices[ring, :2] for ring in boundary_rings(Floor(floor.vertices, floor.faces[near]))]
    outer = max(rings, key=lambda ring: Polygon(ring).area)
    region = Polygon(outer, [*(ring for ring in rings if ring is not outer), corners])
    vertices = np.vstack([floor.vertices, np.column_stack([corners, floor.heights_at(corners)])])
    stretch = np.concatenate([floor.stretch, floor.stretch_at(corners)]) if floor.is_stretched else floor.stretch
    points, faces = triangulate(region)
    of_region = np.append(np.unique(floor.faces[near]), len(floor.vertices) + np.arange(len(corners)))
    number = {(x, y): k for k, (x, y) in zip(of_region.tolist(), vertices[of_region, :2].tolist(), strict=True)}
    made = np.array([number[x, y] for x, y in points.tolist()])[faces]
    every = np.concatenate([floor.faces[~near], made])
    used, renumbered = np.unique(every, return_inverse=True)
    sheet = np.concatenate([floor.sheet[~near], np.full(len(made), opening.sheet)]).astype(floor.sheet.dtype)
    stretch = stretch[used] if floor.is_stretched else stretch
    return Floor(vertices[used], renumbered.reshape(-1, 3).astype(np.int32), sheet, floor.offset_m, stretch)
