"""Disconnected workings: which of their parts become the world."""

from __future__ import annotations

import cv2
import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from pipeline.errors import GeometryError
from pipeline.geometry.enclosure import as_polygons
from pipeline.types import Frame, Mask

_NEAR_M = 5.0  # a place this far inside rock still means the workings beside it
Places = list[tuple[float, float]]


def choose_component(workings: MultiPolygon, places_m: Places) -> Polygon:
    """Return the part in which all places lie, or the largest where there are none.

    Raises
    ------
    GeometryError
        If a place lies in no part, or two lie in different ones; the message gives the gap between them.
    """
    parts = list(workings.geoms)
    if not places_m:
        return max(parts, key=lambda part: part.area)
    chosen = []
    for x, y in places_m:
        apart = shapely.distance(parts, shapely.Point(x, y))
        if apart.min() > _NEAR_M:
            raise GeometryError(_no_workings_at(x, y, float(apart.min())))
        chosen.append(parts[int(apart.argmin())])
    for (x, y), part in zip(places_m[1:], chosen[1:], strict=True):
        if part is not chosen[0]:
            raise GeometryError(_not_joined(places_m[0], (x, y), part.distance(chosen[0])))
    return chosen[0]


def choose_mask_component(drawn: Mask, frame: Frame, places_m: Places) -> Mask:
    """Return the connected region (rows, cols) in which all places lie, or the largest where there are none.

    Raises
    ------
    GeometryError
        As `choose_component` does.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats(drawn.astype(np.uint8), connectivity=4)
    if count < 2:
        return np.zeros(drawn.shape, dtype=bool)
    if not places_m:
        return labels == 1 + stats[1:, cv2.CC_STAT_AREA].argmax()
    rows, cols = np.nonzero(drawn)
    inked = frame.to_mine(np.column_stack([cols, rows]) + 0.5)
    chosen = []
    for x, y in places_m:
        apart = np.linalg.norm(inked - (x, y), axis=1)
        if apart.min() > _NEAR_M:
            raise GeometryError(_no_workings_at(x, y, float(apart.min())))
        at = int(apart.argmin())
        chosen.append(int(labels[rows[at], cols[at]]))
    for place, label in zip(places_m[1:], chosen[1:], strict=True):
        if label != chosen[0]:
            beyond = cv2.distanceTransform((labels != chosen[0]).astype(np.uint8), cv2.DIST_L2, 5)
            raise GeometryError(_not_joined(places_m[0], place, float(beyond[labels == label].min()) / frame.px_per_m))
    return labels == chosen[0]


def _no_workings_at(x: float, y: float, apart_m: float) -> str:
    return f"no workings at ({x:g}, {y:g}): the nearest are {apart_m:.1f} m away (at most {_NEAR_M:g} m)"


def _not_joined(one: tuple[float, float], other: tuple[float, float], gap_m: float) -> str:
    return (
        f"the workings at ({other[0]:g}, {other[1]:g}) are {gap_m:.2f} m away from those at ({one[0]:g}, {one[1]:g}); "
        "one world holds workings that hang together: contours.bridge_m closes gaps up to twice its value"
    )


def mend(workings: MultiPolygon, bridge_m: float, min_island_m2: float) -> MultiPolygon:
    """Close gaps between parts of vector workings and fill islands too small to be pillars; all else stays as it is.

    Parameters
    ----------
    workings : shapely.MultiPolygon, m
    bridge_m : float
        Gaps up to twice this are closed where that joins two parts.
    min_island_m2 : float
    """
    filled = [
        Polygon(part.exterior, [ring for ring in part.interiors if Polygon(ring).area >= min_island_m2])
        for part in as_polygons(workings).geoms
    ]
    whole = as_polygons(shapely.union_all(filled))
    if bridge_m == 0 or len(whole.geoms) < 2:
        return whole
    closed = whole.buffer(bridge_m, join_style="mitre").buffer(-bridge_m, join_style="mitre")
    bridges = [
        piece for piece in as_polygons(closed.difference(whole)).geoms
        if sum(part.distance(piece) < 1e-9 for part in whole.geoms) > 1
    ]  # fmt: skip
    grown = [piece.buffer(1e-6, join_style="mitre") for piece in bridges]  # so that they share more than an edge
    return as_polygons(shapely.union_all([whole, *grown]))
