"""Areas of levels and ramps that lie over each other, from walls with elevations."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import shapely
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.spatial import cKDTree
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import GeometryError, InputError
from minesurveys.remarks import warn_user
from pipeline.geometry.outline.enclosure import enclose_workings
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.survey.levels.walls import SAME_M, Wall, beside_each_other, falls, is_steep_in_part, lie_over, sampled

_MOUTH_M = 12.0  # two ends of wall strings so near are a drift's end
_NEIGHBOURS = 9  # of an open end, itself first, that are tried
_CLOSED = 0.2  # of a wall's length, that its ends are at most apart if it is closed
TOUCH_M, OVERLAP_M2 = 1e-3, 0.01  # areas that overlap by less only touch
_SAMPLE_M = 1.0  # of the places where two areas are compared
_EQUAL_M = 1e-6
_LEAST_M2 = 0.01


@dataclass
class Area:
    """A piece of floor inside its walls: a polygon in plan, and the walls' points (k, 3) m, which have its heights."""

    polygon: Polygon
    walls: list[Wall]
    _tree: shapely.STRtree | None = field(default=None, repr=False)
    _edges: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3)), repr=False)

    def heights_at(self, places_m: np.ndarray) -> np.ndarray:
        """Return the height (n,) m of the nearest wall at places (n, 2) m, linear between the wall's points."""
        if self._tree is None:
            self._edges = np.concatenate([np.stack([wall[:-1], wall[1:]], axis=1) for wall in self.walls])
            self._tree = shapely.STRtree(shapely.linestrings(self._edges[:, :, :2]))
        start, end = self._edges[self._tree.nearest(shapely.points(places_m))].transpose(1, 0, 2)
        along = (end - start)[:, :2]
        share = ((places_m - start[:, :2]) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12)
        return np.asarray(start[:, 2] + np.clip(share, 0.0, 1.0) * (end - start)[:, 2])


def places_in(shape: BaseGeometry) -> np.ndarray:
    """Return places (n, 2) m all over a shape: about its boundary, and one inside each part."""
    inner = [part.representative_point() for part in shapely.get_parts(shape)]
    return shapely.get_coordinates([shapely.segmentize(shape, _SAMPLE_M), *inner])


def areas_of(path: Path, walls: list[tuple[Wall, str]], snap_m: float, rules: FloorRules = FLOOR_RULES) -> list[Area]:
    """Return the areas that walls enclose at their heights.

    A closed wall encloses an area, or a pillar if it lies in one at its height. Open walls of one layer that are near
    each other at like heights enclose areas together; ends up to 12 m apart are then joined as the end of a drift.

    Parameters
    ----------
    path : Path
    walls : list of ((k, 3) m, layer)
    snap_m : float
        A wall whose ends are no further apart is closed.

    Raises
    ------
    InputError
        If open walls enclose no area, or cross themselves; the message names the layer and the height.
    """
    rings: list[tuple[Wall, str]] = []
    strings: list[tuple[Wall, str]] = []
    for wall, layer in _once(walls):
        around = np.linalg.norm(np.diff(wall, axis=0), axis=1).sum()
        apart = np.linalg.norm(wall[0] - wall[-1])
        is_closed = len(wall) > 2 and apart <= max(min(snap_m, _CLOSED * around), _EQUAL_M)
        (rings if is_closed else strings).append((wall, layer))
    rings = [(wall, layer) for wall, layer in rings if _has_area(wall)]
    areas = [
        area
        for cluster in beside_each_other(strings, rules)
        for area in _enclosed_if_level(path, cluster, snap_m, rules)
    ]
    return _nested(areas, [_ring(path, wall, layer, rules) for wall, layer in rings], rules)


def _once(walls: list[tuple[Wall, str]]) -> list[tuple[Wall, str]]:
    """Return walls without those that are in the drawing twice, in either direction."""
    distinct: dict[tuple[str, bytes], tuple[Wall, str]] = {}
    for wall, layer in walls:
        both = sorted(np.ascontiguousarray(line.round(3) + 0.0).tobytes() for line in (wall, wall[::-1]))
        distinct.setdefault((layer, both[0]), (wall, layer))
    return list(distinct.values())


def _has_area(wall: Wall) -> bool:
    """Return whether a closed wall encloses anything: a line that only goes there and back does not."""
    return bool(shapely.make_valid(Polygon(wall[:, :2])).area > _LEAST_M2) if len(wall) > 3 else False


def _ring(path: Path, wall: Wall, layer: str, rules: FloorRules) -> Area:
    ring = np.vstack([wall[:-1], wall[:1]])
    polygon = Polygon(ring[:, :2])
    if not polygon.is_valid or _touches_over([ring], rules):
        x, y = ring[0, :2]
        raise InputError(
            f"{path}: a wall of layer {layer!r} that begins at ({x:.1f}, {y:.1f}), {ring[0, 2]:.1f} m high, crosses "
            "itself in plan; draw a ramp that turns above itself in pieces that do not, or read its centreline by "
            "--half-width"
        )
    return Area(polygon, [ring])


def _touches_over(walls: list[Wall], rules: FloorRules) -> bool:
    """Return whether walls touch in plan at different heights, as the ends of a ramp of a whole turn do."""
    points = np.concatenate([sampled(wall) for wall in walls])
    one, two = cKDTree(points[:, :2]).query_pairs(SAME_M, output_type="ndarray").T
    return bool((abs(points[one, 2] - points[two, 2]) > rules.flat_step_m).any())


def _nested(areas: list[Area], rings: list[Area], rules: FloorRules) -> list[Area]:
    """Return areas and rings as areas: a ring that lies at its height in an odd number of others is a pillar."""
    distinct = {
        (shapely.normalize(ring.polygon).wkb, round(float(ring.walls[0][:, 2].max()), 1)): ring for ring in rings
    }
    every = [*areas, *sorted(distinct.values(), key=lambda ring: -ring.polygon.area)]
    tree = shapely.STRtree([area.polygon for area in every])
    depth, inside = [0] * len(every), defaultdict(list)
    for other, area in enumerate(every):
        covered = sorted(set(tree.query(area.polygon, predicate="covers").tolist()) - {other, *range(len(areas))})
        for number in _at_its_height(area, {k: every[k].walls[0] for k in covered}, rules):
            depth[number] += 1
            inside[number].append(other)
    polygons: dict[int, BaseGeometry] = {k: area.polygon for k, area in enumerate(every) if depth[k] % 2 == 0}
    walls = {k: [*every[k].walls] for k in polygons}
    for number, ring in enumerate(every):
        if depth[number] % 2:
            outer = max((k for k in inside[number] if depth[k] == depth[number] - 1), default=None)
            if outer is not None:
                polygons[outer] = polygons[outer].difference(ring.polygon)
                walls[outer] += ring.walls
    return [
        Area(part, walls[k])
        for k, polygon in polygons.items()
        for part in shapely.get_parts(polygon)
        if part.area > _LEAST_M2
    ]


def _at_its_height(area: Area, rings: dict[int, Wall], rules: FloorRules) -> list[int]:
    """Return the rings in an area that lie at its height.

    They are found from its walls inwards, as each gives the height of the floor about it: in a room with many pillars
    the nearest outer wall may be far off, and the floor may dip.
    """
    step, walls, found, rest = rules.flat_step_m, [*area.walls], list[int](), dict(rings)
    while rest:
        known = np.concatenate([sampled(wall) for wall in walls])
        apart = dict.fromkeys(rest, np.inf)
        for model in (NearestNDInterpolator, LinearNDInterpolator):
            height_at = model(known[:, :2], known[:, 2])
            for number, wall in rest.items():
                if apart[number] > step:
                    apart[number] = float(np.median(abs(height_at(wall[:, :2]) - wall[:, 2])))
            if min(apart.values()) <= step:
                break
        met = [number for number, difference in apart.items() if difference <= step]
        if not met:
            break
        walls += [rest.pop(number) for number in met]
        found += met
    return found


def _enclosed_if_level(path: Path, strings: list[tuple[Wall, str]], snap_m: float, rules: FloorRules) -> list[Area]:
    """Return what open walls of one drift enclose, if need be without inclined lines that are no walls.

    These are lines that are too steep to drive in part, and one that falls alone.
    """
    inclined = [is_steep_in_part(wall, rules) or (len(strings) == 1 and falls(wall, rules)) for wall, _ in strings]
    if not any(inclined):
        return _enclosed(path, strings, snap_m, rules)
    try:
        return _enclosed(path, strings, snap_m, rules)
    except InputError as error:
        lines = [wall for (wall, _), is_one in zip(strings, inclined, strict=True) if is_one]
        rest = [string for string, is_one in zip(strings, inclined, strict=True) if not is_one]
        found = _enclosed(path, rest, snap_m, rules) if rest else []
        (x, y, z), low = lines[0][lines[0][:, 2].argmax()], lines[0][:, 2].min()
        warn_user(
            f"inclined lines of layer {strings[0][1]!r} are neither walls nor the axis of one shaft, and "
            f"are left out, the first at ({x:.1f}, {y:.1f}) from {z:.1f} to {low:.1f} m: "
            f"{str(error).removeprefix(f'{path}: ')}",
            of=path.name,
            count=len(lines),
        )
        return found


def _enclosed(path: Path, strings: list[tuple[Wall, str]], snap_m: float, rules: FloorRules) -> list[Area]:
    """Return what open walls of one drift enclose, with the ends of the drift closed."""
    walls = [wall for wall, _ in strings]
    x, y, z = walls[0][0]
    where = f"layer {strings[0][1]!r} about ({x:.1f}, {y:.1f}), {z:.1f} m high"
    if lie_over(strings, rules) or _touches_over(walls, rules):
        raise InputError(
            f"{path}: open walls of {where} are joined to walls over or under them; close the walls of each level, or "
            "put each level and each ramp on a layer of its own"
        )
    closers = _mouths(walls, snap_m)
    lines = [LineString(wall[:, :2]) for wall in (*walls, *closers)]
    crossed = next((line for line in lines if not line.is_simple), None)
    if crossed is not None:
        raise InputError(
            f"{path}: a wall of {where} crosses itself in plan; draw a ramp that turns above itself in pieces that do "
            "not, or read its centreline by --half-width"
        )
    try:
        enclosed: BaseGeometry = enclose_workings(lines, snap_m, [])
    except GeometryError as error:
        raise InputError(f"{path}: the open walls of {where}: {error}") from error
    except shapely.GEOSException as error:
        raise InputError(f"{path}: the open walls of {where} are too tangled to enclose an area") from error
    around = enclosed.boundary.buffer(SAME_M)
    unused = [line for line in lines[: len(walls)] if line.intersection(around).length < line.length / 2]
    if unused:
        x, y = unused[0].coords[0]
        warn_user(
            f"open walls of {where} bound no area, the first from ({x:.1f}, {y:.1f}); are the right ends "
            "joined? --snap states the widest gap",
            of=path.name,
            count=f"{len(unused)} of {len(walls)}",
            option="--snap",
        )
    return [
        Area(part, [wall for wall in (*walls, *closers) if part.boundary.distance(LineString(wall[:, :2])) < SAME_M])
        for part in shapely.get_parts(enclosed)
    ]


def _mouths(walls: list[Wall], snap_m: float) -> list[Wall]:
    """Return lines that join the open ends of walls two by two, the nearest first: the ends of drifts."""
    ends = np.array([wall[k] for wall in walls for k in (0, -1)])
    free = ends[cKDTree(ends).query(ends, k=2)[0][:, 1] > max(snap_m, _EQUAL_M)]
    if len(free) < 2:
        return []
    apart, other = cKDTree(free).query(free, k=min(len(free), _NEIGHBOURS))
    found: list[Wall] = []
    used: set[int] = set()
    for flat in np.argsort(apart, axis=None, kind="stable").tolist():
        one, rank = divmod(flat, apart.shape[1])
        two = int(other[one, rank])
        if apart[one, rank] > _MOUTH_M:
            break
        if one != two and not used & {one, two}:
            used |= {one, two}
            found.append(free[[one, two]])
    return found
