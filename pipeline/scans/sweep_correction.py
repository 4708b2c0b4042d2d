"""Correct the walls of a plan by sweeps: take off the bias in width, and follow the sweeps where there are some."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import Polygon

from minesurveys.errors import GeometryError
from pipeline.geometry.outline.enclosure import as_polygons
from pipeline.geometry.polyline import arc_length
from pipeline.geometry.raycast import RayCaster, upright_walls
from pipeline.scans.registration import Fan, Pose

_MATCH_M = 1.0  # a return farther from the wall shows something that the plan does not, such as a vehicle
_TAPER_M = 1.5  # over which a wall goes from the sweep's to the plan's
_BREAK_M = 0.6  # returns farther apart belong to two walls
_NARROWEST_M = 1.5  # no robot and no vehicle drives in narrower parts
_SLIVER_M = 0.05
_SPECK_M2 = 1.0
_MID_M = 0.5  # height at which rays are cast against walls 1 m high


def narrow_drifts(free: Polygon, inward_m: float) -> Polygon:
    """Move all walls of a free space inward by a distance, m; a negative distance widens the drifts.

    Parts that are then narrower than 1.5 m are removed, and corners of the workings get a radius of 0.75 m: where walls
    are moved inward, notches and tips of dead ends would become narrow gaps.

    Raises
    ------
    GeometryError
        If that closes a drift: the message gives the distance and what is cut off.
    """
    eroded = free.buffer(-inward_m - _NARROWEST_M / 2, join_style="mitre")
    narrowed = as_polygons(eroded.buffer(_NARROWEST_M / 2, quad_segs=4))
    if narrowed.is_empty:
        raise GeometryError(f"sweeps: no drift is wider than {2 * inward_m:.2f} m, the bias in width")
    whole = max(narrowed.geoms, key=lambda part: part.area)
    cut_off = narrowed.area - whole.area
    if cut_off > 0.05 * narrowed.area:
        raise GeometryError(
            f"sweeps: drifts narrower than {2 * inward_m:.2f} m, the bias in width, connect {cut_off:.0f} m2 of the "
            "workings; that much of the plan would be cut off"
        )
    return whole


def caster_of(free: Polygon) -> RayCaster:
    """Return a caster of rays against a free space's walls."""
    return RayCaster(upright_walls(free, 2 * _MID_M))


def cast_fan(caster: RayCaster, pose: Pose, bearing: np.ndarray) -> np.ndarray:
    """Return the ranges (n,) m of beams at bearings (n,) rad of a scanner at a pose."""
    return caster.fan(np.array([pose[:2]]), (pose[2] + bearing)[None], _MID_M)[0]


def follow_sweeps(free: Polygon, fans: dict[str, Fan], poses: dict[str, Pose]) -> tuple[Polygon, dict[str, float]]:
    """Move the walls that sweeps see onto their returns.

    Between each pair of neighbouring returns, the strip between the plan's wall and the sweep's becomes rock if the
    sweep is nearer, and free space if it is farther. Returns more than 1 m from the plan's wall are not followed. At
    the ends of a stretch of wall that a sweep sees, the wall goes back to the plan's over 1.5 m.

    Parameters
    ----------
    free : shapely.Polygon, m, mine frame
    fans : dict of (bearings (n,) rad, ranges (n,) m)
    poses : dict of (x, y, heading)
        The scanner's, m, rad, mine frame.

    Returns
    -------
    shapely.Polygon, m
        One component without specks.
    dict of float
        The length of wall, m, that follows each sweep.
    """
    caster = caster_of(free)
    rock: list[Polygon] = []
    opened: list[Polygon] = []
    followed = {}
    for name, (bearing, measured) in fans.items():
        order = np.argsort(bearing)
        bearing, measured = bearing[order], measured[order]
        drawn = cast_fan(caster, poses[name], bearing)
        length = 0.0
        for stretch in _stretches(bearing, measured, np.abs(measured - drawn) <= _MATCH_M):
            seen = _points(poses[name], bearing[stretch], measured[stretch])
            along = arc_length(seen)
            length += along[-1]
            weight = np.clip(np.minimum(along, along[-1] - along) / _TAPER_M, 0.0, 1.0)
            moved = drawn[stretch] + weight * (measured[stretch] - drawn[stretch])
            strips = _strips(poses[name], bearing[stretch], drawn[stretch], moved)
            nearer = (moved[1:] + moved[:-1]) < (drawn[stretch][1:] + drawn[stretch][:-1])
            rock += [strip for strip, is_rock in zip(strips, nearer, strict=True) if is_rock]
            opened += [strip for strip, is_rock in zip(strips, nearer, strict=True) if not is_rock]
        followed[name] = round(float(length), 1)
    # Each strip is grown a little, so that neighbours overlap.
    grown = [shapely.union_all(shapely.buffer(strips, 1e-3)) for strips in (rock, opened)]
    return _whole(free.difference(grown[0]).union(grown[1]), free), followed


def _stretches(bearing: np.ndarray, measured: np.ndarray, matched: np.ndarray) -> list[np.ndarray]:
    """Return the indices of each stretch of wall: neighbouring returns that match the plan, without a break."""
    points = measured[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    breaks = np.flatnonzero((step > _BREAK_M) | ~(matched[1:] & matched[:-1])) + 1
    pieces = np.split(np.arange(len(bearing)), breaks)
    return [piece for piece in pieces if len(piece) > 2]


def _points(pose: Pose, bearing: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    heading = pose[2] + bearing
    return np.array(pose[:2]) + ranges[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])


def _strips(pose: Pose, bearing: np.ndarray, one: np.ndarray, other: np.ndarray) -> list[Polygon]:
    """Return the quadrilaterals between two walls, one for each pair of neighbouring beams."""
    a, b = _points(pose, bearing, one), _points(pose, bearing, other)
    quads = np.stack([a[:-1], a[1:], b[1:], b[:-1]], axis=1)
    return [shapely.convex_hull(shapely.MultiPoint(quad)) for quad in quads]


def _whole(corrected: Polygon, free: Polygon) -> Polygon:
    """Return the largest component without slivers and specks.

    Raises
    ------
    GeometryError
        If the sweeps divide the workings or add a pillar.
    """
    smooth = corrected.buffer(_SLIVER_M).buffer(-2 * _SLIVER_M).buffer(_SLIVER_M)
    whole = max(as_polygons(smooth).geoms, key=lambda part: part.area)
    whole = Polygon(whole.exterior, [ring for ring in whole.interiors if Polygon(ring).area > _SPECK_M2])
    if len(whole.interiors) != len(free.interiors) or whole.area < 0.9 * free.area:
        raise GeometryError(
            f"sweeps: following them turns {len(free.interiors)} pillars and {free.area:.0f} m2 into "
            f"{len(whole.interiors)} pillars and {whole.area:.0f} m2; are the poses right? "
            "survey.correct=null keeps the plan's walls"
        )
    return whole
