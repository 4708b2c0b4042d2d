"""Openings in plan: the workings and the floor's mesh with and without them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.floors.floor import Floor
from minexplore.floors.shaft_axis import aside_at
from pipeline.geometry.floor.wall_foot import boundary_rings
from pipeline.geometry.rock.partition import triangulate
from pipeline.types import Opening, Openings

UNDER_BEND_M = 0.3  # a roof is at least, where a leaning shaft meets it: its slab ends below the bend
_BESIDE_M = 0.05  # faces so near to an opening are cut anew, so that none is a sliver
_DIGITS = 4


def lower_aside_m(opening: Opening) -> np.ndarray:
    """Return how far (2,) m aside of its outline the lower end of a shaft is."""
    return aside_at(opening.bends_m, opening.bottom_m)


def roof_round(opening: Opening, floor: Floor, height_m: float) -> tuple[np.ndarray, float]:
    """Return the roof's height (k,) m at the corners of a raise, and how much higher it is between them.

    It is linear on each face of the floor's mesh, so that the borders of faces suffice.
    """
    roof, corners = floor.raised(height_m), np.array(opening.outline_m)
    heights, uneven_m = roof.heights_at(corners), 0.0
    triangles = roof.vertices[roof.faces][:, :, :2]
    near = shapely.intersects(shapely.polygons(triangles), polygon_of_opening(opening))
    borders = shapely.linearrings(triangles[near & (roof.sheet == opening.plan_sheet)])
    for k in range(len(corners)):
        after = (k + 1) % len(corners)
        along = corners[after] - corners[k]
        places = shapely.get_coordinates(shapely.intersection(borders, shapely.LineString(corners[[k, after]])))
        share = (places - corners[k]) @ along / (along @ along)
        straight = heights[k] + share * (heights[after] - heights[k])
        uneven_m = max(uneven_m, float((roof.heights_at(places) - straight).max(initial=0.0)))
    return heights, uneven_m


def polygon_of_opening(opening: Opening) -> Polygon:
    """Return an opening in plan."""
    return Polygon(opening.outline_m)


def _cut(part: Polygon, openings: Sequence[Opening]) -> Polygon:
    return Polygon(part.exterior, [*part.interiors, *(o.outline_m for o in openings)]) if openings else part


def without_openings(outline: BaseGeometry, openings: Openings) -> BaseGeometry:
    """Return the workings as if openings were floor: the network of drifts is that of these."""
    if not openings.collars:
        return outline
    rings = {frozenset(opening.outline_m) for opening in openings.collars}
    parts = [
        Polygon(part.exterior, [ring for ring in part.interiors if frozenset(ring.coords) not in rings])
        for part in shapely.get_parts(outline)
    ]
    return parts[0] if isinstance(outline, Polygon) else MultiPolygon(parts)


def filled_floor(floor: Floor, openings: Openings) -> Floor:
    """Return a floor that `cut_floor` made with faces over its openings: visible rock is made over it."""
    return floor.filled(np.array(opening.outline_m) for opening in openings.collars)


def cut_floor(floor: Floor, openings: Openings) -> Floor:
    """Return a floor without its faces over openings.

    The faces about an opening are triangulated anew, with the opening's corners at the height that the floor has there.
    """
    for opening in openings.collars:
        floor = _without_faces(floor, opening)
    return floor


def _without_faces(floor: Floor, opening: Opening) -> Floor:
    corners = np.array(opening.outline_m)
    triangles = shapely.polygons(floor.vertices[floor.faces, :2])
    near = shapely.intersects(triangles, polygon_of_opening(opening).buffer(_BESIDE_M)) & (
        floor.sheet == opening.plan_sheet
    )
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
    sheet = np.concatenate([floor.sheet[~near], np.full(len(made), opening.plan_sheet)]).astype(floor.sheet.dtype)
    stretch = stretch[used] if floor.is_stretched else stretch
    return Floor(vertices[used], renumbered.reshape(-1, 3).astype(np.int32), sheet, floor.offset_m, stretch)
