"""Disconnected workings: which connected component becomes the world."""

from __future__ import annotations

import cv2
import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from pipeline.errors import GeometryError
from pipeline.geometry.outline.enclosure import as_polygons
from pipeline.types import Frame, Mask

NEAR_M = 5.0  # a place in rock selects the nearest workings up to this distance
_NECK_M = 0.05  # workings thinner than twice this connect nothing: two areas that touch in a corner, say
_SLIVER_M2 = 0.01  # smaller pieces are rounding along a wall
_SPIKE_M = 0.5  # a corner so thin and longer is cut off; the notches of rough walls are shorter
Places = list[tuple[float, float]]


def choose_component(workings: MultiPolygon, places_m: Places) -> Polygon:
    """Return the component that contains all places, or the largest component if there are no places.

    Raises
    ------
    GeometryError
        If a place lies in no component, or two places lie in different ones; the message gives the distance.
    """
    components = list(workings.geoms)
    if not places_m:
        return max(components, key=lambda component: component.area)
    chosen = []
    for x, y in places_m:
        distance_m = shapely.distance(components, shapely.Point(x, y))
        chosen.append(components[_nearest((x, y), distance_m)])
    for (x, y), component in zip(places_m[1:], chosen[1:], strict=True):
        if component is not chosen[0]:
            raise GeometryError(_not_connected(places_m[0], (x, y), component.distance(chosen[0])))
    return chosen[0]


def choose_mask_component(drawn: Mask, frame: Frame, places_m: Places) -> Mask:
    """Return the component (rows, cols) that contains all places, or the largest if there are no places.

    Raises
    ------
    GeometryError
        As for `choose_component`.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats(drawn.astype(np.uint8), connectivity=4)
    if count < 2:
        return np.zeros(drawn.shape, dtype=bool)
    if not places_m:
        return labels == 1 + stats[1:, cv2.CC_STAT_AREA].argmax()
    rows, cols = np.nonzero(drawn)
    centres = frame.to_mine(np.column_stack([cols, rows]) + 0.5)
    chosen = []
    for x, y in places_m:
        at = _nearest((x, y), np.linalg.norm(centres - (x, y), axis=1))
        chosen.append(int(labels[rows[at], cols[at]]))
    for place, label in zip(places_m[1:], chosen[1:], strict=True):
        if label != chosen[0]:
            distance_px = cv2.distanceTransform((labels != chosen[0]).astype(np.uint8), cv2.DIST_L2, 5)
            gap_m = float(distance_px[labels == label].min()) / frame.px_per_m
            raise GeometryError(_not_connected(places_m[0], place, gap_m))
    return labels == chosen[0]


def _nearest(place_m: tuple[float, float], distance_m: np.ndarray) -> int:
    """Return the index of the workings that a place selects, by their distances (k,) m from it."""
    if distance_m.min() > NEAR_M:
        x, y = place_m
        raise GeometryError(
            f"no workings at ({x:g}, {y:g}): the nearest are {distance_m.min():.1f} m away (at most {NEAR_M:g} m); "
            "contours.components chooses the part that is built"
        )
    return int(distance_m.argmin())


def _not_connected(one: tuple[float, float], other: tuple[float, float], gap_m: float) -> str:
    return (
        f"the workings at ({other[0]:g}, {other[1]:g}) are {gap_m:.2f} m away from those at ({one[0]:g}, {one[1]:g}); "
        "a world holds one connected component; contours.bridge_m closes gaps up to twice its value"
    )


def mend(workings: MultiPolygon, bridge_m: float, min_island_m2: float) -> MultiPolygon:
    """Close gaps between components of vector workings, part them at necks, and fill islands too small to be pillars.

    A neck is thinner than 10 cm. The tips of sharp corners that are so thin for over 0.5 m are cut off. Components
    without either stay as they are.

    Parameters
    ----------
    workings : shapely.MultiPolygon, m
    bridge_m : float
        Gaps up to twice this are closed where that connects two components.
    min_island_m2 : float
    """
    filled = [
        Polygon(component.exterior, [ring for ring in component.interiors if Polygon(ring).area >= min_island_m2])
        for component in as_polygons(workings).geoms
    ]
    whole = as_polygons(shapely.union_all(filled))
    if bridge_m == 0 or len(whole.geoms) < 2:
        return _part_at_necks(whole)
    closed = whole.buffer(bridge_m, join_style="mitre").buffer(-bridge_m, join_style="mitre")
    bridges = [
        piece
        for piece in as_polygons(closed.difference(whole)).geoms
        if sum(component.distance(piece) < 1e-9 for component in whole.geoms) > 1
    ]
    # A bridge must overlap its components, not only touch them.
    grown = [piece.buffer(1e-6, join_style="mitre") for piece in bridges]
    return _part_at_necks(as_polygons(shapely.union_all([whole, *grown])))


def _part_at_necks(workings: MultiPolygon) -> MultiPolygon:
    """Return workings without necks, which part a component, and without spikes; others stay as they are."""
    parted: list[Polygon] = []
    for component in workings.geoms:
        cores = as_polygons(component.buffer(-_NECK_M, join_style="mitre")).geoms
        parts = [core.buffer(_NECK_M, join_style="mitre").intersection(component) for core in cores]
        thin = np.array(
            [p for p in as_polygons(component.difference(shapely.union_all(parts))).geoms if p.area > _SLIVER_M2]
        )
        sides = shapely.bounds(thin).reshape(-1, 2, 2)
        has_spike = bool((np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1) > _SPIKE_M).any())
        is_cut = len(parts) > 1 or (len(parts) == 1 and has_spike)  # what is thin everywhere stays, to be refused later
        parted += [p for part in parts for p in as_polygons(part).geoms] if is_cut else [component]
    return MultiPolygon(parted)
