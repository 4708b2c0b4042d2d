"""Openings in plan: where a shaft fits into its drift, and the workings and the floor's mesh with and without them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import SLAB_M
from minexplore.floors.floor import Floor
from minexplore.floors.shaft_axis import aside_at
from pipeline.geometry.floor.wall_foot import boundary_rings
from pipeline.geometry.rock.partition import triangulate
from pipeline.types import Heights, Opening, Openings, Shaft

_SIDES_M, _WIDEST_M = (1.5, 1.0), 6.0  # of a collar, tried after the surveyed width; the least lets a robot fall in
_FROM_WALL_M = 0.1
_PASSAGE_M = 0.9  # a robot of 0.7 m passes
_POCKET_M2 = 6.0  # of places for a robot's middle that an opening may cut off, at a dead end
_FROM_SEAM_M = 2.0
_BETWEEN_M = 0.5  # of rock between the walls of a raise and another shaft's
LEAST_RAISE_M = 1.0  # over the roof
UNEVEN_M = 0.2  # of a roof round a raise, whose walls begin as high as it is at most, within the slab
_BESIDE_STATION_M = 0.25  # that the wall of a raise may be, where its station stands at the end of a drift
_SLACK_M = 1e-3  # corners are rounded
_AROUND_M = 15.0  # of a shaft that are looked at
_EVEN_M, _EVEN_HEIGHT_M, _TURNED = 0.5, 0.01, 0.02  # shots so near to a long collar lie in one plane; sine of 1 deg
_APART_STEP_M = 0.25  # of heights at which two shafts that lean are compared
UNDER_BEND_M = 0.3  # a roof is at least, where a leaning shaft meets it: its slab ends below the bend
_BESIDE_M = 0.05  # faces so near to an opening are cut anew, so that none is a sliver
_DIGITS = 4

Seams = list[BaseGeometry]


def fit_openings(outline: BaseGeometry, heights: Heights) -> tuple[Openings, list[str]]:
    """Return the openings that fit into the workings, and a line for each shaft that does not.

    A collar is a square along its drift, as wide as surveyed if it fits, else 1.5 or 1 m. It fits if rock is all round
    it, if a robot passes beside it or the drift ends behind it, and if the shaft meets the roof of the drift below. A
    raise is such a square in the roof; it fits if rock is all round it and no other shaft is near. It need not be about
    the station: where that is at a wall it is moved, as little as possible, to at most 0.25 m beside the station. A
    stope is a rectangle, as long as surveyed; where none fits, its shafts are tried one by one.

    Parameters
    ----------
    outline : shapely polygon, one a sheet, m, plan
    heights : Heights
    """
    plan = _SheetPlan(outline, heights)
    built: list[Opening] = []
    left_out = []
    stopes: list[Opening] = []
    for shaft in heights.shafts:
        if any(_is_part(shaft, stope) for stope in stopes):
            continue
        sides = dict.fromkeys((*([min(shaft.side_m, _WIDEST_M)] if shaft.side_m else []), *_SIDES_M))
        openings = (plan.opening(shaft, along, across) for along, across in _sizes(shaft, list(sides)))
        opening = next((opening for opening in openings if opening and plan.takes(opening, built)), None)
        if opening is not None:
            built.append(opening)
            stopes += [opening] if shaft.long_m else []
        else:
            left_out.append(_left_out(shaft, min(sides)))
    return Openings(built), left_out


def _sizes(shaft: Shaft, sides_m: list[float]) -> list[tuple[float, float]]:
    """Return how long and wide a shaft may be, m, along and across its drift; the first that fits is built."""
    return [(shaft.long_m, side) for side in sides_m] if shaft.long_m else [(side, side) for side in sides_m]


def _is_part(shaft: Shaft, stope: Opening) -> bool:
    """Return whether a shaft begins in a stope that is built."""
    same = (shaft.sheet, shaft.below) == (stope.sheet, stope.below)
    return same and polygon_of_opening(stope).intersects(shapely.Point(shaft.place_m))


def _left_out(shaft: Shaft, side_m: float) -> str:
    (x, y), (top, bottom) = shaft.place_m, shaft.stations
    size = f"{side_m:g} m wide" if shaft.long_m is None else f"{shaft.long_m:.1f} m long and {side_m:g} m wide"
    if shaft.sheet is None:
        return (
            f"the raise from {bottom} to {top} at ({x:.1f}, {y:.1f}) is left out: {size}, it does not fit "
            "into the roof of its drift, or is too near to another shaft"
        )
    return (
        f"the shaft from {top} to {bottom} at ({x:.1f}, {y:.1f}) is left out: {size}, it has no "
        f"{_PASSAGE_M:g} m of drift beside it, is within {_FROM_SEAM_M:g} m of a seam of two sheets, or misses "
        "the drift below"
    )


class _SheetPlan:
    """The sheets of the workings in plan, and the seams between them."""

    def __init__(self, outline: BaseGeometry, heights: Heights) -> None:
        self._parts = shapely.get_parts(outline)
        self._offset_m = np.array(heights.offset_m)
        pairs = [pair for line in heights.lines for pair in pairwise(line)]
        self._shots = np.array(pairs, dtype=float).reshape(-1, 2, 3)
        self._tree = shapely.STRtree(shapely.linestrings(self._shots[:, :, :2]))
        self._seams: Seams = [
            shapely.LineString(np.array(seam.ends_m) + heights.offset_m[k])
            for seam in heights.seams
            for k in seam.sheets
        ]

    def opening(self, shaft: Shaft, along_m: float, across_m: float) -> Opening | None:
        """Return the opening of a shaft of a size; None for a raise that finds no place near its station."""
        corners = _rectangle(shaft, along_m, across_m)
        if shaft.sheet is None:
            assert shaft.below is not None
            place, inset = np.array(shaft.place_m), _FROM_WALL_M + _SLACK_M
            near = self._parts[shaft.below].intersection(shapely.Point(place).buffer(_AROUND_M + (shaft.long_m or 0.0)))
            inner = near.buffer(-inset, join_style="mitre")
            room: BaseGeometry = Polygon(corners).buffer(_BESIDE_STATION_M, join_style="mitre")
            for corner in corners:
                room = room.intersection(shapely.transform(inner, lambda xy, aside=corner - place: xy - aside))
            if room.is_empty:
                return None
            moved = shapely.get_coordinates(shapely.shortest_line(room, shapely.Point(place)))[0]
            corners = (corners + (moved - place)).round(_DIGITS)
        ring = tuple((float(x), float(y)) for x, y in corners)
        return Opening(ring, shaft.sheet, shaft.below, shaft.top_m, shaft.bottom_m, shaft.bends_m)

    def takes(self, opening: Opening, built: list[Opening]) -> bool:
        """Return whether an opening fits beside those that are built."""
        collar, sheet, below = polygon_of_opening(opening), opening.sheet, opening.below
        if below is not None:
            aside = self._offset_m[below] - self._offset_m[opening.plan_sheet] + lower_aside_m(opening)
            if not _is_over(self._parts[below], Polygon(np.array(opening.outline_m) + aside), self._seams):
                return False
        near = built if sheet is None or opening.bends_m else [other for other in built if other.bends_m]
        if any(self._meet(opening, other) for other in near):
            return False
        if sheet is None:
            return True
        if _longer_m(collar) > 0 and not self._is_even(collar):
            return False
        part = _cut(self._parts[sheet], [other for other in built if other.sheet == sheet])
        return _fits(part, collar, self._seams)

    def _is_even(self, collar: Polygon) -> bool:
        """Return whether the floor about a long collar is one plane: its drift is straight there, and of one grade."""
        corners = shapely.get_coordinates(collar)[:3]
        along = max(np.diff(corners, axis=0), key=lambda edge: float(np.linalg.norm(edge)))
        along = along / np.linalg.norm(along)
        shots = self._shots[self._tree.query(collar, predicate="dwithin", distance=_EVEN_M)]
        steps = np.diff(shots[:, :, :2], axis=1)[:, 0]
        length = np.linalg.norm(steps, axis=1)
        if (np.abs(steps @ [along[1], -along[0]]) > _TURNED * length).any():
            return False
        places = shots.reshape(-1, 3)
        line = np.column_stack([places[:, :2] @ along, np.ones(len(places))])
        fit, *_ = np.linalg.lstsq(line, places[:, 2], rcond=None)
        off = places[:, 2] - line @ fit
        return bool(np.abs(off).max(initial=0.0) < _EVEN_HEIGHT_M)

    def _meet(self, one: Opening, two: Opening) -> bool:
        """Return whether two shafts have less than half a metre of rock between them at one height."""
        high, low = min(one.top_m, two.top_m), max(one.bottom_m, two.bottom_m)
        if high <= low:
            return False
        sections = [np.array(o.outline_m) - self._offset_m[o.plan_sheet] for o in (one, two)]
        if not (one.bends_m or two.bends_m):
            if np.abs(sections[0][0] - sections[1][0]).max() > _AROUND_M + _WIDEST_M + np.ptp(sections, axis=1).max():
                return False
            return bool(Polygon(sections[0]).distance(Polygon(sections[1])) < 2 * SLAB_M + _BETWEEN_M)
        levels = np.arange(low, high + _APART_STEP_M, _APART_STEP_M)
        ours, theirs = (
            shapely.polygons(section + aside_at(o.bends_m, levels)[:, None])
            for o, section in zip((one, two), sections, strict=True)
        )
        return bool(shapely.distance(ours, theirs).min() < 2 * SLAB_M + _BETWEEN_M)


def lower_aside_m(opening: Opening) -> np.ndarray:
    """Return how far (2,) m aside of its outline the lower end of a shaft is."""
    return aside_at(opening.bends_m, opening.bottom_m)


def raises_over_roofs(openings: Openings, floor: Floor, height_m: float) -> tuple[Openings, list[str]]:
    """Return the openings without the raises that end in a roof or just over it, and a line for each of these.

    Parameters
    ----------
    openings : Openings
    floor : Floor
    height_m : float
        From the floor to the roof.
    """
    kept, left_out = [], []
    for opening in openings.shafts:
        if opening.sheet is not None:
            kept.append(opening)
            continue
        roof_m, uneven_m = roof_round(opening, floor, height_m)
        over_m = opening.top_m - float(roof_m.max()) - uneven_m
        x, y = np.mean(opening.outline_m, axis=0)
        where = f"the raise at ({x:.1f}, {y:.1f}) is left out"
        if uneven_m > UNEVEN_M:
            left_out.append(f"{where}: the roof there is uneven by {uneven_m:.2f} m, at most {UNEVEN_M:g} m")
        elif opening.bends_m and float(roof_m.max()) + uneven_m + UNDER_BEND_M > opening.bends_m[-1][2]:
            left_out.append(f"{where}: it leans, and the roof there is higher than the survey's")
        elif over_m < LEAST_RAISE_M:
            left_out.append(f"{where}: it ends {over_m:.1f} m over the roof of its drift, want {LEAST_RAISE_M:g} m")
        else:
            kept.append(opening)
    return Openings(kept), left_out


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


def _rectangle(shaft: Shaft, along_m: float, across_m: float) -> np.ndarray:
    """Return the corners (4, 2) m of a collar, counter-clockwise, in plan."""
    c, s = np.cos(shaft.heading_rad), np.sin(shaft.heading_rad)
    corners = np.array([along_m, across_m]) / 2 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return np.asarray((corners @ np.array([(c, s), (-s, c)]) + shaft.place_m).round(_DIGITS))


def _fits(part: Polygon, collar: Polygon, seams: Seams) -> bool:
    """Return whether a collar lies in a sheet, and the drift beside it stays passable or ends behind it."""
    near = part.intersection(collar.centroid.buffer(_AROUND_M + _longer_m(collar)))
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


def _longer_m(collar: Polygon) -> float:
    """Return by how much a collar is longer than wide, m; 0 of a square."""
    corners = shapely.get_coordinates(collar)[:3]
    return float(abs(np.subtract(*np.linalg.norm(np.diff(corners, axis=0), axis=1)).round(_DIGITS - 1)))


def _is_over(below: Polygon, section: Polygon, seams: Seams) -> bool:
    """Return whether a shaft meets the roof of the sheet below, off its walls and seams."""
    return bool(below.contains(section.buffer(_FROM_WALL_M))) and all(
        seam.distance(section) > _FROM_WALL_M for seam in seams
    )


def polygon_of_opening(opening: Opening) -> Polygon:
    """Return an opening in plan."""
    return Polygon(opening.outline_m)


def cut_openings(outline: BaseGeometry, openings: Openings) -> BaseGeometry:
    """Return the workings with openings in their floor as islands; all other corners stay."""
    parts = [
        _cut(part, [o for o in openings.collars if part.contains(polygon_of_opening(o))])
        for part in shapely.get_parts(outline)
    ]
    return parts[0] if isinstance(outline, Polygon) else MultiPolygon(parts)


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
